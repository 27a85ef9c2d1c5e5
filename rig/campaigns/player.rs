//! Plays a case of a campaign under virtual time without a recording, and keeps its result.

use masseter_analysis::Figures;
use masseter_campaign::{CampaignFolder, Case, CaseResult};
use masseter_report::Verdict;
use masseter_runtime::clock;
use masseter_scenario::Scenario;
use masseter_terminal::{Exit, Failure, OrFailure, in_one_line};

use crate::arguments::ControllerKind;
use crate::guarded::guarded;
use crate::interrupts::Interrupts;
use crate::run::figures_unrecorded;

/// Plays cases by one controller.
pub(super) struct Player<'a> {
    pub(super) controller: ControllerKind,
    pub(super) interrupts: &'a Interrupts,
}

impl Player<'_> {
    /// The result of a case: the kept one, or that of playing it now; none if the user interrupts.
    pub(super) fn settle(&self, folder: &CampaignFolder, case: &Case) -> Result<Option<CaseResult>, Failure> {
        if let Some(kept) = folder.result_of(case).incomplete()? {
            return Ok(Some(kept));
        }
        let attempt = folder.attempt(case).incomplete()?;
        let Some(result) = self.play(case)? else { return Ok(None) };
        attempt.finish(&result, case.scenario.as_ref().ok()).incomplete()?;
        Ok(Some(result))
    }

    /// Plays a case and judges it; none if the user interrupts. What the machine refuses, such as memory, is no result.
    fn play(&self, case: &Case) -> Result<Option<CaseResult>, Failure> {
        let began_ns = clock::now_ns();
        let refused = |reason| CaseResult::without_run(case, CaseResult::REFUSED, Exit::Usage as u8, reason);
        let scenario = match &case.scenario {
            Ok(scenario) => scenario,
            Err(reason) => return Ok(Some(refused(reason.clone()))),
        };
        let judged = self.judge(scenario);
        if self.interrupts.is_stop_requested() {
            return Ok(None);
        }
        let took_s = || (clock::now_ns() - began_ns) as f64 / 1e9;
        Ok(Some(match judged {
            Ok((verdict, figures)) => CaseResult::new(case, &verdict, &figures, took_s()),
            Err(Failure { exit: Exit::Usage, error }) => refused(in_one_line(&error)),
            Err(Failure { exit: Exit::Died, error }) => {
                CaseResult::without_run(case, CaseResult::DIED, Exit::Died as u8, in_one_line(&error))
            }
            Err(failure) => return Err(failure),
        }))
    }

    /// The verdict on a scenario, and its figures.
    ///
    /// # Errors
    /// [`Exit::Usage`] for a scenario that cannot be played.
    pub(super) fn judge(&self, scenario: &Scenario) -> Result<(Verdict, Figures), Failure> {
        guarded(|| {
            let (manifest, figures) = figures_unrecorded(scenario, self.controller, self.interrupts)?;
            Ok((Verdict::new(&manifest, &figures), figures))
        })
    }
}
