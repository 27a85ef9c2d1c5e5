//! A row of the matrix: what a fault did, and who detected it.

use masseter_analysis::Figures;
use masseter_model::geometry::AXIS_NAMES;
use masseter_report::Verdict;
use masseter_runtime::messages::codes::EventKind;
use masseter_scenario::ChecksConfig;

use super::case::Case;

/// The first line of the CSV file.
pub(super) const HEADER: &str = "kind,layer,axis,phase,size,struck,detected_by,cause,latency_ms,deviation_mm,deviation_deg,end_state,verdict\n";

/// What a fault came to.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
pub(super) enum Coverage {
    /// It never acted.
    Idle,
    /// Nobody detected it, and the jaw stayed within the limits.
    Harmless,
    /// It was detected before the jaw left the limits.
    Detected,
    /// It was detected too late.
    Late,
    /// Nobody detected it, and the jaw left the limits.
    Undetected,
}

impl Coverage {
    /// The word for it.
    pub(super) fn word(self) -> &'static str {
        match self {
            Self::Idle => "never struck",
            Self::Harmless => "within the limits, undetected",
            Self::Detected => "detected in time",
            Self::Late => "detected too late",
            Self::Undetected => "beyond the limits, undetected",
        }
    }
}

/// A row.
#[derive(Debug, Clone)]
pub(super) struct Row {
    pub(super) case: Case,
    pub(super) coverage: Coverage,
    /// Who detected it first, and as what.
    pub(super) detection: Option<(String, String)>,
    latency_ms: Option<f64>,
    pub(super) deviation_mm: f64,
    pub(super) deviation_deg: f64,
    end_state: String,
    verdict: &'static str,
}

impl Row {
    pub(super) fn new(case: Case, figures: &Figures, verdict: &Verdict, limits: &ChecksConfig) -> Self {
        let fault = &figures.faults[0];
        let struck_ns = fault.struck_ns;
        // A drive's emergency is a detection too, although it stops nothing by itself.
        let first = struck_ns.and_then(|struck_ns| {
            let events = figures.events.iter().filter(|event| event.time_ns >= struck_ns);
            events.into_iter().find(|event| event.kind == EventKind::Fault)
        });
        // The negation also counts what is no number.
        let is_beyond =
            !(fault.deviation_mm <= limits.tracking_max_mm && fault.deviation_deg <= limits.tracking_max_deg);
        let coverage = match (struck_ns, first, is_beyond) {
            (None, ..) => Coverage::Idle,
            (_, None, false) => Coverage::Harmless,
            (_, None, true) => Coverage::Undetected,
            (_, Some(_), false) => Coverage::Detected,
            (_, Some(_), true) => Coverage::Late,
        };
        Self {
            case,
            coverage,
            detection: first.map(|event| (event.source.to_string(), event.cause.to_string())),
            latency_ms: first
                .zip(struck_ns)
                .map(|(event, struck_ns)| (event.time_ns - struck_ns) as f64 / 1e6),
            deviation_mm: fault.deviation_mm,
            deviation_deg: fault.deviation_deg,
            end_state: figures.final_state.map(|state| state.to_string()).unwrap_or_default(),
            verdict: verdict.word,
        }
    }

    /// The axis by name; empty where the fault has none.
    pub(super) fn axis(&self) -> &'static str {
        self.case.axis.map_or("", |axis| AXIS_NAMES[axis])
    }

    /// The line of the CSV file.
    pub(super) fn line(&self) -> String {
        let Case { fault, phase, .. } = &self.case;
        let (source, cause) = self.detection.clone().unwrap_or_else(|| ("nobody".to_owned(), String::new()));
        let size = fault.size.map(|size| size.to_string()).unwrap_or_default();
        let latency = self.latency_ms.map(|latency_ms| format!("{latency_ms:.3}")).unwrap_or_default();
        format!(
            "{},{},{},{phase},{size},{},{source},{cause},{latency},{:.4},{:.4},{},{}\n",
            fault.kind,
            fault.kind.layer().name(),
            self.axis(),
            self.coverage != Coverage::Idle,
            self.deviation_mm,
            self.deviation_deg,
            self.end_state,
            self.verdict
        )
    }
}
