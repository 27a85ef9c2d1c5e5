//! The rig's interface for controllers in C and C++; `shared/interface/masseter.h` documents every function.
//!
//! Each function returns a result and keeps its message for [`masseter_error`]. No panic leaves this library: it becomes an
//! error. A session belongs to the thread that attached.
#![allow(unsafe_code, reason = "C passes pointers")]

mod law;
mod outcome;

use std::ffi::{CStr, c_char, c_int, c_void};
use std::time::Duration;

use masseter_controller::process;
use masseter_shared::control::{Outcome, Session, Tick, Waited};
use masseter_shared::lifecycle::ProcessContext;
use masseter_shared::lifecycle::attach::attach;
use masseter_shared::messages::{Command, Event, Reading, State};

use law::{CLaw, LawFunction};
use outcome::{Failure, OK, SAFE_STOP, TIMED_OUT, guarded};

/// An attached program.
#[derive(Debug)]
pub struct MasseterSession {
    stage: Stage,
    period_ns: u64,
}

#[derive(Debug)]
enum Stage {
    Attached(Box<ProcessContext>),
    Started(Box<Session>),
    /// A start has failed.
    Over,
}

/// A cycle that has begun.
#[repr(C)]
#[derive(Debug, Clone, Copy)]
pub struct MasseterCycle {
    cycle: u64,
    now_ns: u64,
    has_reading: u32,
    unused: u32,
}

impl MasseterSession {
    fn started(&mut self) -> Result<&mut Session, Failure> {
        match &mut self.stage {
            Stage::Started(session) => Ok(session),
            Stage::Attached(_) | Stage::Over => {
                Err("the session is not started: call masseter_start first".into())
            }
        }
    }
}

/// The message of the last error in this thread; it lasts until the next call.
#[unsafe(no_mangle)]
pub extern "C" fn masseter_error() -> *const c_char {
    outcome::message()
}

/// Attaches to a rig.
///
/// # Safety
/// `rig` is null or a string; `session` is a valid pointer.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn masseter_attach(rig: *const c_char, session: *mut *mut MasseterSession) -> c_int {
    guarded(|| {
        // SAFETY: a string, by the contract of this function.
        let rig = unsafe { text(rig) }?;
        let context = attach(rig)?;
        let period_ns = context.scenario.period_ns();
        let attached = MasseterSession { stage: Stage::Attached(Box::new(context)), period_ns };
        // SAFETY: valid by the contract of this function.
        unsafe { session.as_mut() }
            .map(|session| *session = Box::into_raw(Box::new(attached)))
            .ok_or(NULL)?;
        Ok(OK)
    })
}

/// Opens the ports, reports ready, waits for the start.
///
/// # Safety
/// `session` is null or from [`masseter_attach`].
#[unsafe(no_mangle)]
pub unsafe extern "C" fn masseter_start(session: *mut MasseterSession) -> c_int {
    guarded(|| {
        // SAFETY: as this function's.
        let session = unsafe { session.as_mut() }.ok_or(NULL)?;
        match std::mem::replace(&mut session.stage, Stage::Over) {
            Stage::Attached(context) => {
                session.stage = Stage::Started(Box::new(Session::start(*context)?));
                Ok(OK)
            }
            stage => {
                session.stage = stage;
                Err("the session is started already".into())
            }
        }
    })
}

/// Time from one cycle to the next, ns; 0 without a session.
///
/// # Safety
/// `session` is null or from [`masseter_attach`].
#[unsafe(no_mangle)]
pub unsafe extern "C" fn masseter_period_ns(session: *const MasseterSession) -> u64 {
    // SAFETY: as this function's.
    unsafe { session.as_ref() }.map_or(0, |session| session.period_ns)
}

/// Waits for the next cycle.
///
/// # Safety
/// `session` is null or from [`masseter_attach`]; `cycle` and `reading` are valid pointers.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn masseter_wait(
    session: *mut MasseterSession,
    timeout_ns: i64,
    cycle: *mut MasseterCycle,
    reading: *mut Reading,
) -> c_int {
    guarded(|| {
        // SAFETY: as this function's.
        let (session, cycle, reading) = unsafe { (session.as_mut(), cycle.as_mut(), reading.as_mut()) };
        let session = session.ok_or(NULL)?.started()?;
        let (cycle, reading) = (cycle.ok_or(NULL)?, reading.ok_or(NULL)?);
        let timeout = u64::try_from(timeout_ns).ok().map(Duration::from_nanos);
        let Waited::Cycle { tick: Tick { cycle: number, now_ns }, reading: new } = session.wait(timeout)?
        else {
            return Ok(TIMED_OUT);
        };
        *cycle = MasseterCycle { cycle: number, now_ns, has_reading: u32::from(new.is_some()), unused: 0 };
        *reading = new.unwrap_or_default();
        Ok(OK)
    })
}

/// Publishes this cycle's command and state.
///
/// # Safety
/// `session` is null or from [`masseter_attach`]; `command` and `state` are valid.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn masseter_publish(
    session: *mut MasseterSession,
    command: *const Command,
    state: *const State,
) -> c_int {
    guarded(|| {
        // SAFETY: as this function's.
        let (session, command, state) = unsafe { (session.as_mut(), command.as_ref(), state.as_ref()) };
        session.ok_or(NULL)?.started()?.publish(command.ok_or(NULL)?, state.ok_or(NULL)?)?;
        Ok(OK)
    })
}

/// Publishes an event.
///
/// # Safety
/// `session` is null or from [`masseter_attach`]; `event` is valid.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn masseter_publish_event(session: *mut MasseterSession, event: *const Event) -> c_int {
    guarded(|| {
        // SAFETY: as this function's.
        let (session, event) = unsafe { (session.as_mut(), event.as_ref()) };
        session.ok_or(NULL)?.started()?.publish_event(event.ok_or(NULL)?)?;
        Ok(OK)
    })
}

/// 1 once the rig wants an orderly end.
///
/// # Safety
/// `session` is null or from [`masseter_attach`].
#[unsafe(no_mangle)]
pub unsafe extern "C" fn masseter_is_stop_requested(session: *const MasseterSession) -> c_int {
    // SAFETY: as this function's.
    match unsafe { session.as_ref() }.map(|session| &session.stage) {
        Some(Stage::Started(session)) => c_int::from(session.is_stop_requested()),
        Some(Stage::Attached(context)) => c_int::from(context.stop.is_made()),
        Some(Stage::Over) | None => 1,
    }
}

/// Ends the work in order, and frees the session.
///
/// # Safety
/// `session` is null or from [`masseter_attach`], and not used again.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn masseter_finish(session: *mut MasseterSession, is_safe_stop: c_int) -> c_int {
    let outcome = if is_safe_stop == 0 { Outcome::Finished } else { Outcome::SafeStop };
    // SAFETY: as this function's.
    guarded(|| match unsafe { owned(session) }?.stage {
        Stage::Started(session) => Ok(session.finish(outcome).map(|()| OK)?),
        Stage::Attached(_) | Stage::Over => Err("the session is not started".into()),
    })
}

/// Ends the work with a reason, and frees the session.
///
/// # Safety
/// `session` is null or from [`masseter_attach`], and not used again; `reason` is null or a string.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn masseter_fail(session: *mut MasseterSession, reason: *const c_char) -> c_int {
    guarded(|| {
        // SAFETY: as this function's.
        let (session, reason) = unsafe { (owned(session)?, text(reason)?) };
        if let Stage::Started(session) = session.stage {
            session.fail(reason.unwrap_or("no reason is given"))?;
        }
        Ok(OK)
    })
}

/// Runs the rig's own controller with a pose law, to its end, and frees the session.
///
/// # Safety
/// `session` is null or from [`masseter_attach`], and not used again; `law` may be called with `user` until this returns.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn masseter_run(
    session: *mut MasseterSession,
    law: Option<LawFunction>,
    user: *mut c_void,
) -> c_int {
    guarded(|| {
        // SAFETY: as this function's.
        let session = unsafe { owned(session) }?;
        let law = CLaw { function: law.ok_or(NULL)?, user };
        let Stage::Attached(context) = session.stage else {
            return Err("the session is started already: call masseter_run instead of masseter_start".into());
        };
        Ok(match process::run_with_law(*context, Box::new(law))? {
            Outcome::Finished => OK,
            Outcome::SafeStop => SAFE_STOP,
        })
    })
}

const NULL: Failure = Failure::of("a pointer is null");

/// # Safety
/// `session` is null or from [`masseter_attach`], and not used again.
unsafe fn owned(session: *mut MasseterSession) -> Result<MasseterSession, Failure> {
    // SAFETY: made by Box::into_raw, by the contract of this function.
    if session.is_null() { Err(NULL) } else { Ok(*unsafe { Box::from_raw(session) }) }
}

/// A string of C; none for null.
///
/// # Safety
/// `text` is null or ends with a zero.
unsafe fn text<'a>(text: *const c_char) -> Result<Option<&'a str>, Failure> {
    if text.is_null() {
        return Ok(None);
    }
    // SAFETY: as this function's.
    let text = unsafe { CStr::from_ptr(text) }.to_str();
    text.map(Some).map_err(|_| Failure::of("a string is not UTF-8"))
}
