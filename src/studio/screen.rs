//! What pages see of the solve: which pictures they watch, in what order these are sent, and how far the solve was when they were told last.

use std::collections::HashMap;
use std::time::{Duration, Instant};

use tokio::sync::broadcast;

use super::full::Full;
use super::messages::{Kind, Mail, News, Phase, Stage, Told, picture};
use super::pictures::{Seen, Shown, previews};
use crate::Result;
use crate::io::image::rgba_bytes;
use crate::scene::{Image, Rgb};

/// All that pages may watch, in the order in which it is sent.
const KINDS: [Kind; 8] = [
    Kind::After,
    Kind::Before,
    Kind::Target,
    Kind::Difference,
    Kind::Coverage,
    Kind::Conflict,
    Kind::LightMap,
    Kind::Depth,
];
/// Pictures of a preview follow each other at least so far apart, once the first is there.
const APART: Duration = Duration::from_millis(120);

pub(super) struct Screen {
    pages: broadcast::Sender<Mail>,
    /// What each page watches.
    pub(super) watched: HashMap<u64, Vec<Kind>>,
    /// What all pictures are brightened by.
    pub(super) exposure: f64,
    /// The view that was painted on last, which is shown first.
    pub(super) painted: usize,
    /// The change of strokes that previews show.
    pub(super) followed: u64,
    /// Whether the light map lies elsewhere than when pages saw all pictures last.
    pub(super) is_moved: bool,
    /// Counts pictures.
    serial: u64,
    began: Instant,
    last_picture: Instant,
    standing: Option<Standing>,
}

/// What has changed since pictures were sent.
#[derive(Clone, Copy, PartialEq)]
pub(super) enum Changes {
    /// The light map.
    Light,
    /// The paint, and the light map with it.
    Paint,
    /// What pages show, or how bright.
    All,
}

impl Changes {
    fn reach(self, kind: Kind) -> bool {
        match kind {
            Kind::After | Kind::Difference | Kind::Conflict | Kind::LightMap => true,
            Kind::Target => self != Self::Light,
            Kind::Before | Kind::Coverage | Kind::Depth => self == Self::All,
            // Drawn when it is asked for, or when looks are told.
            Kind::Free | Kind::Transfer => false,
        }
    }
}

/// How far a solve is, as pages know it.
#[derive(Clone, Copy)]
struct Standing {
    phase: Phase,
    iteration: usize,
    gradient: f64,
    met: Option<f64>,
    at: Duration,
}

impl Screen {
    pub(super) fn new(pages: broadcast::Sender<Mail>) -> Self {
        let now = Instant::now();
        Self {
            pages,
            watched: HashMap::new(),
            exposure: 1.0,
            painted: 0,
            followed: 0,
            is_moved: false,
            serial: 0,
            began: now,
            last_picture: now,
            standing: None,
        }
    }

    /// From here on a solve counts its seconds.
    pub(super) fn begin(&mut self) {
        self.began = Instant::now();
    }

    pub(super) fn tell(&self, told: &Told<'_>) {
        // Where nobody listens nobody needs to be told.
        _ = self.pages.send(Mail { to: None, sent: told.sent() });
    }

    /// Tells only the page that has asked.
    pub(super) fn answer(&self, page: u64, told: &Told<'_>) {
        _ = self.pages.send(Mail { to: Some(page), sent: told.sent() });
    }

    pub(super) fn notice(&self, kind: News, text: String) {
        self.tell(&Told::Notice { kind, text });
    }

    /// Whether it is time for the next picture of a preview.
    pub(super) fn is_due(&self) -> bool {
        self.last_picture.elapsed() > APART
    }

    /// Sends the pictures that have changed, of those that some page shows, under a sun of that radiance; the share of the paint that is met.
    ///
    /// Errors: those of making previews.
    pub(super) fn show(
        &mut self,
        seen: &Seen<'_>,
        full: Option<&Full>,
        light: Rgb,
        changes: Changes,
    ) -> Result<Option<f64>> {
        self.last_picture = Instant::now();
        let is_watched = |kind| self.watched.values().any(|kinds| kinds.contains(&kind));
        let kinds: Vec<Kind> =
            KINDS.into_iter().filter(|&kind| is_watched(kind) && changes.reach(kind)).collect();
        let (serial, pages, followed) = (&mut self.serial, &self.pages, self.followed);
        let mut send = |Shown { kind, view, stage, size, bytes }: Shown| {
            *serial += 1;
            let sent = picture((kind, view), (stage, *serial, followed), size, &bytes);
            _ = pages.send(Mail { to: None, sent });
        };
        previews(seen, full, (&kinds, self.painted), (light, self.exposure), &mut send)
    }

    /// Sends what the free camera of a page sees.
    pub(super) fn show_free(&mut self, page: u64, seen: &Image) {
        self.show_one(Some(page), Kind::Free, seen, self.exposure);
    }

    /// Sends the colours of a transfer function.
    pub(super) fn show_transfer(&mut self, table: &Image) {
        self.show_one(None, Kind::Transfer, table, 1.0);
    }

    fn show_one(&mut self, to: Option<u64>, kind: Kind, image: &Image, exposure: f64) {
        self.serial += 1;
        let stage = (Stage::Preview, self.serial, self.followed);
        let sent = picture((kind, None), stage, image.size(), &rgba_bytes(image, exposure));
        _ = self.pages.send(Mail { to, sent });
    }

    /// Tells how far the solve is.
    pub(super) fn progress(
        &mut self,
        phase: Phase,
        (iteration, gradient): (usize, f64),
        met: Option<f64>,
        full: Option<&Full>,
    ) {
        // JSON knows no NaN.
        let gradient = if gradient.is_finite() { gradient } else { 1.0 };
        self.standing = Some(Standing { phase, iteration, gradient, met, at: self.began.elapsed() });
        self.tell_progress(full);
    }

    /// Tells it once more.
    pub(super) fn tell_progress(&self, full: Option<&Full>) {
        let Some(Standing { phase, iteration, gradient, met, at }) = self.standing else { return };
        let remarks = full.map_or(&[][..], |full| &full.remarks);
        let details = full.map_or(&[][..], |full| &full.details);
        let seconds = at.as_secs_f64();
        self.tell(&Told::Progress { phase, iteration, gradient, met, seconds, remarks, details });
    }
}
