//! The page and the socket that it talks through, for this machine alone.
//!
//! Only whoever has the address with its token is let in. `Host` and `Origin` are compared with a list, so that no page of another site
//! can reach it, by whatever name it finds this machine (DNS rebinding).

use std::net::{Ipv4Addr, SocketAddr};
use std::sync::Arc;
use std::sync::atomic::{AtomicU64, Ordering};
use std::sync::mpsc::Sender;
use std::time::{Duration, Instant};

use axum::Router;
use axum::extract::ws::{CloseFrame, Message, WebSocket, WebSocketUpgrade};
use axum::extract::{Path, Query, Request, State};
use axum::http::header::{
    CACHE_CONTROL, CONTENT_SECURITY_POLICY, CONTENT_TYPE, HOST, ORIGIN, REFERRER_POLICY,
    X_CONTENT_TYPE_OPTIONS,
};
use axum::http::{HeaderMap, HeaderName, HeaderValue, StatusCode};
use axum::middleware::{Next, from_fn_with_state};
use axum::response::{IntoResponse, Response};
use axum::routing::get;
use serde::Deserialize;
use tokio::net::TcpListener;
use tokio::sync::broadcast::{self, error::RecvError};

use super::errands::Order;
use super::messages::{Asked, Mail, News, Sent, Told};
use super::page;
use crate::job::Stop;
use crate::{Error, Result};

/// Bytes of a message at most: a stroke of 10,000 points has half of that.
const MOST_BYTES: usize = 1 << 20;
/// Messages that a page may send in a second.
const MOST_MESSAGES: u32 = 200;
/// Pages at once.
const MOST_PAGES: u64 = 16;
/// How often to look whether somebody wants to stop.
const LOOK: Duration = Duration::from_millis(100);

/// Nothing is loaded from elsewhere, and nothing of the page is run that does not come from a file of it.
const POLICY: &str = "default-src 'none'; script-src 'self'; style-src 'self'; img-src 'self' blob: data:; connect-src 'self'; base-uri 'none'; form-action 'none'; frame-ancestors 'none'";

/// What every request needs.
pub(super) struct Door {
    token: String,
    port: u16,
    orders: Sender<Order>,
    pages: broadcast::Sender<Mail>,
    /// Numbers that pages get.
    number: AtomicU64,
    open: AtomicU64,
}

impl Door {
    /// A door whose token is new.
    ///
    /// Errors: [`Error::Machine`] where the system has no random numbers.
    pub(super) fn new(port: u16, orders: Sender<Order>, pages: broadcast::Sender<Mail>) -> Result<Self> {
        let mut bytes = [0; 16];
        getrandom::fill(&mut bytes)
            .map_err(|error| Error::Machine(format!("the system gives no random numbers: {error}")))?;
        let token = bytes.iter().map(|byte| format!("{byte:02x}")).collect();
        Ok(Self { token, port, orders, pages, number: AtomicU64::new(1), open: AtomicU64::new(0) })
    }

    /// What to open in a browser.
    pub(super) fn address(&self) -> String {
        format!("http://127.0.0.1:{}/?token={}", self.port, self.token)
    }

    fn names(&self) -> [String; 2] {
        ["127.0.0.1", "localhost"].map(|name| format!("{name}:{}", self.port))
    }

    /// Whether a request names this machine and comes from a page of it, or from no page.
    fn is_ours(&self, headers: &HeaderMap) -> bool {
        let text = |name: HeaderName| headers.get(name).map(|value| value.to_str().unwrap_or("?").to_owned());
        let names = self.names();
        let is_here = text(HOST).is_some_and(|host| names.contains(&host));
        let is_from_here =
            text(ORIGIN).is_none_or(|origin| names.iter().any(|name| origin == format!("http://{name}")));
        is_here && is_from_here
    }

    /// Compared in a time that does not tell how much of it is right.
    fn fits(&self, token: &str) -> bool {
        let difference = token.bytes().zip(self.token.bytes()).fold(0, |all, (a, b)| all | (a ^ b));
        token.len() == self.token.len() && difference == 0
    }
}

/// A port of this machine alone; any that is free for 0.
///
/// Errors: [`Error::Machine`] where it is taken.
pub(super) fn listen(port: u16) -> Result<std::net::TcpListener> {
    let address = SocketAddr::from((Ipv4Addr::LOCALHOST, port));
    let listener = std::net::TcpListener::bind(address).and_then(|listener| {
        listener.set_nonblocking(true)?;
        Ok(listener)
    });
    listener.map_err(|error| {
        Error::Machine(format!("port {port} cannot be used: {error}; leave `port` away to take a free one"))
    })
}

/// Serves until somebody asks to stop.
///
/// Errors: [`Error::Machine`].
pub(super) fn serve(listener: std::net::TcpListener, door: Arc<Door>, stop: &Stop) -> Result<()> {
    let failed = |error: std::io::Error| Error::Machine(format!("the studio cannot serve its page: {error}"));
    let runtime = tokio::runtime::Builder::new_current_thread().enable_all().build().map_err(failed)?;
    let stop = stop.clone();
    runtime.block_on(async move {
        let listener = TcpListener::from_std(listener).map_err(failed)?;
        let stopped = async move {
            while !stop.is_asked() {
                tokio::time::sleep(LOOK).await;
            }
        };
        // Sockets that are open do not hold it up.
        tokio::select! {
            served = async { axum::serve(listener, routes(door)).await } => served.map_err(failed),
            () = stopped => Ok(()),
        }
    })
}

fn routes(door: Arc<Door>) -> Router {
    Router::new()
        .route("/", get(index))
        .route("/socket", get(socket))
        .route("/{file}", get(file))
        .layer(from_fn_with_state(door.clone(), guard))
        .with_state(door)
}

/// Lets in what is ours, and gives every answer its policy.
async fn guard(State(door): State<Arc<Door>>, request: Request, next: Next) -> Response {
    let mut response = match door.is_ours(request.headers()) {
        true => next.run(request).await,
        false => (StatusCode::FORBIDDEN, "this address is for its own page alone\n").into_response(),
    };
    let headers = response.headers_mut();
    for (name, value) in [
        (CONTENT_SECURITY_POLICY, POLICY),
        (X_CONTENT_TYPE_OPTIONS, "nosniff"),
        (REFERRER_POLICY, "no-referrer"),
        (CACHE_CONTROL, "no-store"),
        (HeaderName::from_static("cross-origin-resource-policy"), "same-origin"),
    ] {
        headers.insert(name, HeaderValue::from_static(value));
    }
    response
}

#[derive(Deserialize)]
struct Ticket {
    #[serde(default)]
    token: String,
}

fn refused() -> Response {
    let text = "the address lacks its token, or has another one: open the address that `unscatter paint` has printed\n";
    (StatusCode::FORBIDDEN, text).into_response()
}

fn served(name: &str) -> Response {
    match page::file(name) {
        Some((kind, text)) => ([(CONTENT_TYPE, kind)], text).into_response(),
        None => (StatusCode::NOT_FOUND, "no such file\n").into_response(),
    }
}

async fn index(State(door): State<Arc<Door>>, Query(ticket): Query<Ticket>) -> Response {
    if door.fits(&ticket.token) { served("index.html") } else { refused() }
}

/// Scripts and styles hold nothing secret.
async fn file(Path(name): Path<String>) -> Response {
    if name == "index.html" { refused() } else { served(&name) }
}

async fn socket(
    State(door): State<Arc<Door>>,
    Query(ticket): Query<Ticket>,
    headers: HeaderMap,
    upgrade: WebSocketUpgrade,
) -> Response {
    // A browser always says where a socket comes from.
    if !door.fits(&ticket.token) || !headers.contains_key(ORIGIN) {
        return refused();
    }
    if door.open.load(Ordering::Relaxed) >= MOST_PAGES {
        return (StatusCode::SERVICE_UNAVAILABLE, "too many pages are open\n").into_response();
    }
    upgrade.max_message_size(MOST_BYTES).max_frame_size(MOST_BYTES).on_upgrade(|socket| talk(socket, door))
}

/// One page: what it asks for goes to the worker, and what the worker tells goes to it.
async fn talk(mut socket: WebSocket, door: Arc<Door>) {
    let page = door.number.fetch_add(1, Ordering::Relaxed);
    door.open.fetch_add(1, Ordering::Relaxed);
    let mut told = door.pages.subscribe();
    let mut rate = Rate { since: Instant::now(), count: 0 };
    if door.orders.send(Order::Joined(page)).is_ok() {
        loop {
            let goes_on = tokio::select! {
                message = socket.recv() => match message {
                    Some(Ok(message)) => hear(message, page, &door, &mut rate, &mut socket).await,
                    _ => false,
                },
                news = told.recv() => match news {
                    Ok(Mail { to, .. }) if to.is_some_and(|to| to != page) => true,
                    Ok(Mail { sent: Sent::Text(text), .. }) => {
                        socket.send(Message::Text((*text).into())).await.is_ok()
                    }
                    Ok(Mail { sent: Sent::Picture(bytes), .. }) => {
                        socket.send(Message::Binary(bytes)).await.is_ok()
                    }
                    // A page that is too slow gets everything as it is now.
                    Err(RecvError::Lagged(_)) => {
                        told = told.resubscribe();
                        door.orders.send(Order::Joined(page)).is_ok()
                    }
                    Err(RecvError::Closed) => false,
                },
            };
            if !goes_on {
                break;
            }
        }
    }
    _ = door.orders.send(Order::Left(page));
    door.open.fetch_sub(1, Ordering::Relaxed);
}

/// How many messages have come within a second.
struct Rate {
    since: Instant,
    count: u32,
}

/// Whether the page may stay.
async fn hear(message: Message, page: u64, door: &Door, rate: &mut Rate, socket: &mut WebSocket) -> bool {
    if rate.since.elapsed() > Duration::from_secs(1) {
        *rate = Rate { since: Instant::now(), count: 0 };
    }
    rate.count += 1;
    if rate.count > MOST_MESSAGES {
        let frame = CloseFrame { code: 1008, reason: "too many messages".into() };
        _ = socket.send(Message::Close(Some(frame))).await;
        return false;
    }
    let text = match message {
        Message::Text(text) => text,
        Message::Close(_) => return false,
        _ => return true,
    };
    match serde_json::from_str::<Asked>(&text) {
        Ok(asked) => door.orders.send(Order::Asked(page, asked)).is_ok(),
        Err(error) => {
            let text = format!("this is no message that the studio knows: {error}");
            let Sent::Text(text) = (Told::Notice { kind: News::Error, text }).sent() else { return true };
            socket.send(Message::Text((*text).into())).await.is_ok()
        }
    }
}
