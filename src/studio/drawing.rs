//! What a studio changes of a scene, and how.

use std::sync::Arc;

use serde::{Deserialize, Serialize};
use serde_json::Value;

use crate::io::scene_file::{Group, Stroke, View};

/// The strokes of one view.
pub(super) type Strokes = Arc<Vec<Arc<Stroke>>>;

/// All that a studio changes of a scene, at one moment. Moments share what they have in common.
#[derive(Debug, Clone, PartialEq, Default)]
pub(super) struct Drawing {
    /// Of each view, those that were added included.
    pub(super) views: Vec<Strokes>,
    pub(super) groups: Arc<Vec<Group>>,
    /// Views behind those of the scene's text, without their strokes.
    pub(super) added: Vec<Arc<View>>,
    pub(super) look: Look,
    /// As a scene file has them, without defaults: what a page did not change is saved as it was written.
    pub(super) looks: Arc<Value>,
}

/// What a studio changes of light and air; nothing where they are as the text has them.
#[derive(Debug, Clone, Copy, PartialEq, Default, Serialize, Deserialize)]
pub(super) struct Look {
    /// Where the sun's light goes.
    pub(super) sun: Option<[f64; 3]>,
    /// The mean extinction, in 1/metre.
    pub(super) sigma_t: Option<f64>,
}

/// A change, as a page asks for it and as the journal has it.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(tag = "type", rename_all = "snake_case", deny_unknown_fields)]
pub(super) enum Change {
    /// A stroke on top of the others of a view.
    Paint { view: usize, stroke: Stroke },
    /// Another stroke in the place of one.
    Replace { view: usize, number: usize, stroke: Stroke },
    /// A stroke goes.
    Delete { view: usize, number: usize },
    /// All strokes of a view go.
    Clear { view: usize },
    /// All groups; strokes of those that are no longer there are in none.
    Groups { groups: Vec<Regrouped> },
    /// The sun shines in another direction.
    Sun { direction: [f64; 3], goes_on: bool },
    /// The air is denser or thinner.
    Fog { sigma_t: f64, goes_on: bool },
    /// Shafts are bent and coloured in another way.
    Looks { looks: Value, goes_on: bool },
    /// A view behind the others.
    Add { view: Box<View> },
    /// The last change is taken back.
    Undo,
    /// What was taken back last is done again.
    Redo,
    /// How the journal has what was taken back or done again, which may be older than the journal is.
    Restore(Box<Restored>),
}

/// A group, and what it was called.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct Regrouped {
    name: String,
    #[serde(default)]
    hidden: bool,
    #[serde(default = "one")]
    weight: f64,
    #[serde(default, skip_serializing_if = "Option::is_none")]
    was: Option<String>,
}

#[cfg(test)]
impl Regrouped {
    pub(super) fn new(name: &str, was: Option<&str>) -> Self {
        Self { name: name.to_owned(), hidden: false, weight: 1.0, was: was.map(str::to_owned) }
    }
}

fn one() -> f64 {
    1.0
}

/// What another moment has that is not as it is now.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub(super) struct Restored {
    added: Vec<View>,
    views: Vec<(usize, Vec<Stroke>)>,
    groups: Vec<Group>,
    look: Look,
    looks: Value,
}

/// What is not the same in two moments.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(super) enum Difference {
    /// Paint on some views.
    Paint(Vec<usize>),
    /// Views, light, air or looks: rows are others.
    Rows,
}

impl Drawing {
    /// Of a scene as its text has it.
    pub(super) fn new(views: Vec<Vec<Stroke>>, groups: Vec<Group>, looks: Value) -> Self {
        let views = views.into_iter().map(shared).collect();
        Self { views, groups: groups.into(), looks: looks.into(), ..Self::default() }
    }

    /// How many views are those of the text.
    pub(super) fn own(&self) -> usize {
        self.views.len() - self.added.len()
    }

    /// The views that were added, with their strokes.
    pub(super) fn added(&self) -> Vec<View> {
        let views = self.added.iter().zip(&self.views[self.own()..]);
        views.map(|(view, strokes)| View { strokes: owned(strokes), ..View::clone(view) }).collect()
    }

    /// After a change that takes nothing back; none for one that cannot be.
    pub(super) fn after(&self, change: &Change) -> Option<Self> {
        let mut next = self.clone();
        match change {
            Change::Paint { view, stroke } => {
                next.strokes_of(*view)?.push(Arc::new(stroke.clone()));
            }
            Change::Replace { view, number, stroke } => {
                *next.strokes_of(*view)?.get_mut(*number)? = Arc::new(stroke.clone());
            }
            Change::Delete { view, number } => {
                let strokes = next.strokes_of(*view)?;
                if *number >= strokes.len() {
                    return None;
                }
                strokes.remove(*number);
            }
            Change::Clear { view } => {
                let strokes = next.views.get_mut(*view).filter(|strokes| !strokes.is_empty())?;
                *strokes = Strokes::default();
            }
            Change::Groups { groups } => next.regroup(groups),
            Change::Sun { direction, .. } => {
                let is_direction = direction.iter().all(|c| c.is_finite()) && *direction != [0.0; 3];
                next.look.sun = Some(*direction).filter(|_| is_direction);
                next.look.sun?;
            }
            Change::Fog { sigma_t, .. } => {
                next.look.sigma_t = Some(*sigma_t).filter(|sigma| sigma.is_finite() && *sigma > 0.0);
                next.look.sigma_t?;
            }
            Change::Looks { looks, .. } => next.looks = looks.clone().into(),
            Change::Add { view } => {
                next.views.push(shared(view.strokes.clone()));
                next.added.push(Arc::new(View { strokes: Vec::new(), ..View::clone(view) }));
            }
            Change::Undo | Change::Redo => return None,
            Change::Restore(restored) => {
                next.views.truncate(self.own());
                next.added = restored.added.iter().cloned().map(Arc::new).collect();
                next.views.resize(self.own() + next.added.len(), Strokes::default());
                for (view, strokes) in &restored.views {
                    *next.views.get_mut(*view)? = shared(strokes.clone());
                }
                (next.groups, next.look) = (restored.groups.clone().into(), restored.look);
                next.looks = restored.looks.clone().into();
            }
        }
        Some(next)
    }

    fn strokes_of(&mut self, view: usize) -> Option<&mut Vec<Arc<Stroke>>> {
        self.views.get_mut(view).map(Arc::make_mut)
    }

    fn regroup(&mut self, groups: &[Regrouped]) {
        let group = |it: &Regrouped| Group { name: it.name.clone(), hidden: it.hidden, weight: it.weight };
        let now_called = |name: &str| {
            let renamed = groups.iter().find(|group| group.was.as_deref() == Some(name));
            renamed.or_else(|| groups.iter().find(|group| group.name == name)).map(|group| group.name.clone())
        };
        for strokes in &mut self.views {
            let is_other = |stroke: &Arc<Stroke>| {
                stroke.group.as_deref().is_some_and(|name| now_called(name).as_deref() != Some(name))
            };
            if strokes.iter().any(is_other) {
                for stroke in Arc::make_mut(strokes).iter_mut().filter(|stroke| is_other(stroke)) {
                    let group = stroke.group.as_deref().and_then(now_called);
                    *stroke = Arc::new(Stroke { group, ..Stroke::clone(stroke) });
                }
            }
        }
        self.groups = groups.iter().map(group).collect::<Vec<_>>().into();
    }

    /// What has to be done anew where one follows the other.
    pub(super) fn difference(&self, other: &Self) -> Difference {
        if self.added != other.added || self.look != other.look || self.looks != other.looks {
            return Difference::Rows;
        }
        let is_other = |view: &usize| {
            let [mine, theirs] = [&self.views[*view], &other.views[*view]];
            let groups_count = self.groups != other.groups && mine.iter().any(|it| it.group.is_some());
            groups_count || !(Arc::ptr_eq(mine, theirs) || mine == theirs)
        };
        Difference::Paint((0..self.views.len()).filter(is_other).collect())
    }

    /// What the journal needs to come here from a moment.
    pub(super) fn from(&self, now: &Self) -> Restored {
        let is_same =
            |view: usize| view < now.views.len().min(self.own()) && self.views[view] == now.views[view];
        let views = (0..self.views.len()).filter(|&view| !is_same(view));
        Restored {
            added: self.added.iter().map(|view| View::clone(view)).collect(),
            views: views.map(|view| (view, owned(&self.views[view]))).collect(),
            groups: self.groups.to_vec(),
            look: self.look,
            looks: Value::clone(&self.looks),
        }
    }
}

impl Change {
    /// Whether it goes on with a change of the same kind, as one for undo.
    pub(super) fn goes_on_with(&self, last: Option<&Self>) -> bool {
        match (self, last) {
            (Self::Sun { goes_on, .. }, Some(Self::Sun { .. }))
            | (Self::Fog { goes_on, .. }, Some(Self::Fog { .. }))
            | (Self::Looks { goes_on, .. }, Some(Self::Looks { .. })) => *goes_on,
            _ => false,
        }
    }

    /// Whether it is in the middle of a drag.
    pub(super) fn goes_on(&self) -> bool {
        matches!(
            self,
            Self::Sun { goes_on: true, .. }
                | Self::Fog { goes_on: true, .. }
                | Self::Looks { goes_on: true, .. }
        )
    }

    /// Whether a later one of the same drag makes this one needless.
    pub(super) fn is_overtaken_by(&self, later: &Self) -> bool {
        later.goes_on_with(Some(self))
    }

    /// The later one of a drag in the place of this one: where this one begins a drag, it does.
    pub(super) fn overtaken_by(&self, mut later: Self) -> Self {
        if let Self::Sun { goes_on, .. } | Self::Fog { goes_on, .. } | Self::Looks { goes_on, .. } =
            &mut later
        {
            *goes_on = self.goes_on();
        }
        later
    }
}

pub(super) fn shared(strokes: Vec<Stroke>) -> Strokes {
    Arc::new(strokes.into_iter().map(Arc::new).collect())
}

pub(super) fn owned(strokes: &Strokes) -> Vec<Stroke> {
    strokes.iter().map(|stroke| Stroke::clone(stroke)).collect()
}
