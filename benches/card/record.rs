//! What a run has found, as `card.json` and as a table in `card.md`; both are written again after every step.

use std::fmt::Write;
use std::path::Path;

use serde::Serialize;
use serde_json::Value;

/// How a step ended.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize)]
pub enum Outcome {
    #[serde(rename = "ok")]
    Ok,
    #[serde(rename = "failed")]
    Failed,
    #[serde(rename = "timed out")]
    TimedOut,
    #[serde(rename = "left out")]
    LeftOut,
}

impl Outcome {
    fn name(self) -> &'static str {
        match self {
            Self::Ok => "ok",
            Self::Failed => "failed",
            Self::TimedOut => "timed out",
            Self::LeftOut => "left out",
        }
    }
}

/// One number.
#[derive(Debug, Clone, Serialize)]
pub struct Figure {
    pub what: String,
    pub value: f64,
    pub unit: &'static str,
    /// The floor or aim that it stands against, in words; empty where there is none.
    pub against: String,
    /// All that was measured with it.
    #[serde(skip_serializing_if = "Value::is_null")]
    pub measured: Value,
}

/// What a step has found.
#[derive(Debug, Clone, Serialize)]
pub struct Step {
    pub name: &'static str,
    pub outcome: Outcome,
    pub seconds: f64,
    /// What went wrong, or why it was left out.
    pub notes: Vec<String>,
    pub figures: Vec<Figure>,
}

impl Step {
    pub fn new(name: &'static str) -> Self {
        Self { name, outcome: Outcome::Ok, seconds: 0.0, notes: Vec::new(), figures: Vec::new() }
    }

    /// The first thing that goes wrong decides how the step ended; all are noted.
    pub fn went_wrong(&mut self, outcome: Outcome, note: String) {
        if self.outcome == Outcome::Ok {
            self.outcome = outcome;
        }
        self.notes.push(note);
    }

    pub fn figure(&mut self, what: impl Into<String>, value: f64, unit: &'static str) {
        self.figure_against(what, value, unit, "");
    }

    pub fn figure_against(
        &mut self,
        what: impl Into<String>,
        value: f64,
        unit: &'static str,
        against: impl Into<String>,
    ) {
        let (what, against) = (what.into(), against.into());
        self.figures.push(Figure { what, value, unit, against, measured: Value::Null });
    }
}

/// A run so far.
#[derive(Debug, Serialize)]
pub struct Record {
    pub date: String,
    pub version: Value,
    pub is_dry: bool,
    /// The adapter: its name, interface, driver, kind, abilities and limits.
    pub device: Value,
    pub host: Value,
    pub steps: Vec<Step>,
}

impl Record {
    /// Whether nothing failed or took too long.
    pub fn is_sound(&self) -> bool {
        self.steps.iter().all(|step| matches!(step.outcome, Outcome::Ok | Outcome::LeftOut))
    }

    /// Writes both files.
    pub fn write(&self, folder: &Path) -> std::io::Result<()> {
        std::fs::write(folder.join("card.json"), format!("{:#}\n", serde_json::to_value(self)?))?;
        std::fs::write(folder.join("card.md"), self.table())
    }

    fn table(&self) -> String {
        let word = |value: &Value| value.as_str().map_or_else(|| value.to_string(), str::to_owned);
        let [name, kind, interface, driver] =
            ["name", "kind", "interface", "driver"].map(|key| word(&self.device[key]));
        let [processor, threads] = ["processor", "threads"].map(|key| word(&self.host[key]));
        let mut text = format!(
            "{name} ({kind}, {interface}, {driver}), beside {processor} with {threads} threads; unscatter {}, {}\n\n",
            word(&self.version),
            self.date,
        );
        if self.is_dry {
            text += "**A dry run on a software adapter, at the smallest sizes: these figures say that everything runs, and nothing about a card.**\n\n";
        }
        text += "| step | what | figure | unit | against |\n|---|---|---|---|---|\n";
        for step in &self.steps {
            let _ = writeln!(
                text,
                "| **{}** | {} | {} | s | {} |",
                step.name,
                step.outcome.name(),
                short(step.seconds),
                cell(&step.notes.join("; ")),
            );
            for Figure { what, value, unit, against, .. } in &step.figures {
                let _ =
                    writeln!(text, "| | {} | {} | {unit} | {} |", cell(what), short(*value), cell(against));
            }
        }
        text
    }
}

/// Text that a cell of a table can hold.
fn cell(text: &str) -> String {
    text.replace('|', "\\|").replace('\n', " ")
}

/// A number in three or more digits.
pub fn short(value: f64) -> String {
    match value.abs() {
        0.0 => "0".to_owned(),
        size if !(1e-3..1e7).contains(&size) => format!("{value:.2e}"),
        _ if value.fract() == 0.0 => format!("{value}"),
        size if size >= 100.0 => format!("{value:.0}"),
        size if size >= 1.0 => format!("{value:.2}"),
        _ => format!("{value:.4}"),
    }
}
