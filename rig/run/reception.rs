//! Where programs of the user attach: heard without blocking, admitted or refused with the reason.
//!
//! The rig has one controller. Refusals are counted and said once a second, so that no number of them fills the
//! screen or delays the supervisor.

use anyhow::Context;
use masseter_runtime::conversation::{Conversation, Left, Limits, Newcomers, line};
use masseter_runtime::lifecycle::attach::{Answer, Hello, Invitation, socket};
use masseter_runtime::{clock, transport::Domain};
use masseter_terminal::{Refusals, status};

/// Bytes of the longest greeting.
const LONGEST_HELLO: usize = 4096;
/// Most programs that have not greeted.
const MOST_NEWCOMERS: usize = 16;

/// The socket for programs, and the invitation for the one that is admitted.
pub(super) struct Reception {
    rig: String,
    newcomers: Newcomers,
    invitation: Invitation,
    refusals: Refusals,
}

impl Reception {
    /// Listens at the socket of a domain.
    pub(super) fn open(domain: &Domain, invitation: Invitation) -> anyhow::Result<Self> {
        let path = socket(domain);
        let newcomers = std::os::unix::net::UnixListener::bind(&path)
            .and_then(|listener| {
                Newcomers::at(listener.into(), MOST_NEWCOMERS, Limits::newcomer(LONGEST_HELLO))
            })
            .with_context(|| format!("cannot listen at {}", path.display()))?;
        let rig = domain.id().to_owned();
        let refusals = Refusals::new(
            format!("masseter: a program that attaches to '{rig}' is refused"),
            format!("programs that attach to '{rig}' are refused"),
        );
        Ok(Self { rig, newcomers, invitation, refusals })
    }

    /// Counts a program that was admitted and is out before the start.
    pub(super) fn count_refusal(&mut self, reason: String) {
        self.refusals.count(reason);
    }

    /// The rig's name.
    pub(super) fn rig(&self) -> &str {
        &self.rig
    }

    /// Answers the programs that have greeted. Returns the first one that fits, if the rig has no controller, whose
    /// process id is `controller`, yet. Never blocks.
    pub(super) fn admit(&mut self, controller: Option<u32>) -> Option<Conversation> {
        let now_ns = clock::now_ns();
        let look = self.newcomers.look(now_ns, |bytes| bytes.contains(&b'\n'));
        let mut admitted = None;
        for mut conversation in look.asking {
            // The supervisor names the process of the new one from the next look on.
            let taken_by = controller.or_else(|| admitted.is_some().then_some(0));
            let answer = self.answer(&conversation.next_line().unwrap_or_default(), taken_by);
            conversation.say(line(&answer).as_bytes());
            match answer {
                Answer::Invited(_) => admitted = Some(conversation),
                Answer::Refused { reason } => self.refusals.count(reason),
            }
        }
        // A program that only looks whether somebody listens is none.
        let out = look.out.into_iter().filter(|left| !matches!(left, Left::Closed));
        out.for_each(|left| self.refusals.count(left.to_string()));
        if let Some(line) = self.refusals.line(now_ns) {
            status!("{line}");
        }
        admitted
    }

    fn answer(&self, greeting: &str, controller: Option<u32>) -> Answer {
        let refused = |reason| Answer::Refused { reason };
        let Ok(hello) = serde_json::from_str::<Hello>(greeting) else {
            return refused("its greeting is not that of a controller of this version".to_owned());
        };
        if let Some((theirs, own)) = hello.difference() {
            return refused(format!(
                "it uses the message '{theirs}', the rig '{own}': build it against this version of Masseter"
            ));
        }
        match controller {
            Some(0) => refused("the rig has its controller: stop that one, or start another rig".to_owned()),
            Some(process_id) => refused(format!(
                "the rig has its controller, process {process_id}: stop that one, or start another rig"
            )),
            None => Answer::Invited(self.invitation.clone()),
        }
    }
}

impl Drop for Reception {
    fn drop(&mut self) {
        if let Some(line) = self.refusals.line(u64::MAX) {
            status!("{line}");
        }
    }
}
