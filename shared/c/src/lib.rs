//! The rig's interface for controllers in C and C++; `shared/interface/masseter.h` documents every function.
//!
//! Each function returns a result and keeps its message for [`masseter_error`]. No panic leaves this library: it becomes an
//! error. A session belongs to the thread that attached.
#![allow(unsafe_code, reason = "C passes pointers")]

mod law;
mod outcome;

use std::borrow::Cow;
use std::ffi::{CStr, c_char, c_int, c_void};
use std::time::Duration;

use masseter_controller::process;
use masseter_runtime::control::{Outcome, Session, Tick, Waited};
use masseter_runtime::lifecycle::ProcessContext;
use masseter_runtime::lifecycle::attach::attach;
use masseter_runtime::messages::{Command, Event, Reading, State};
use masseter_runtime::named::{Declared, Parameter, PlayedMotion, Signal};

use law::{CLaw, LawFunction};
use outcome::{Failure, OK, SAFE_STOP, TIMED_OUT, guarded};

/// An attached program.
#[derive(Debug)]
pub struct MasseterSession {
    stage: Stage,
    period_ns: u64,
    declared: Declared,
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
    /// Adds to what is declared before the start; `add` returns how many there are then. Returns the place of the last.
    fn declare(&mut self, add: impl FnOnce(&mut Declared) -> usize) -> Result<c_int, Failure> {
        let Stage::Attached(_) = self.stage else {
            return Err("the session is started: declare before".into());
        };
        let mut declared = self.declared.clone();
        let count = add(&mut declared);
        declared.check()?;
        self.declared = declared;
        Ok(c_int::try_from(count).expect("a few are accepted") - 1)
    }

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
        let attached = MasseterSession {
            stage: Stage::Attached(Box::new(context)),
            period_ns,
            declared: Declared::default(),
        };
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
                let declared = std::mem::take(&mut session.declared);
                session.stage = Stage::Started(Box::new(Session::start(*context, declared)?));
                Ok(OK)
            }
            stage => {
                session.stage = stage;
                Err("the session is started already".into())
            }
        }
    })
}

/// Declares a signal; returns its place.
///
/// # Safety
/// `session` is null or from [`masseter_attach`]; the texts are null or strings.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn masseter_declare_signal(
    session: *mut MasseterSession,
    name: *const c_char,
    unit: *const c_char,
    about: *const c_char,
) -> c_int {
    guarded(|| {
        // SAFETY: as this function's.
        let (session, [name, unit, about]) = unsafe { (session.as_mut(), texts([name, unit, about])?) };
        session.ok_or(NULL)?.declare(|declared| {
            declared.signals.push(Signal { name, unit, about });
            declared.signals.len()
        })
    })
}

/// Declares a parameter; returns its place.
///
/// # Safety
/// `session` is null or from [`masseter_attach`]; the texts are null or strings.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn masseter_declare_parameter(
    session: *mut MasseterSession,
    name: *const c_char,
    unit: *const c_char,
    about: *const c_char,
    value: f64,
    least: f64,
    most: f64,
) -> c_int {
    guarded(|| {
        // SAFETY: as this function's.
        let (session, [name, unit, about]) = unsafe { (session.as_mut(), texts([name, unit, about])?) };
        session.ok_or(NULL)?.declare(|declared| {
            declared.parameters.push(Parameter { name, unit, about, value, range: [least, most] });
            declared.parameters.len()
        })
    })
}

/// Declares that the controller plays a motion of its own, not the scenario's.
///
/// # Safety
/// `session` is null or from [`masseter_attach`].
#[unsafe(no_mangle)]
pub unsafe extern "C" fn masseter_declare_own_motion(session: *mut MasseterSession) -> c_int {
    guarded(|| {
        // SAFETY: as this function's.
        let session = unsafe { session.as_mut() }.ok_or(NULL)?;
        session.declare(|declared| {
            declared.motion = PlayedMotion::Own;
            1
        })
    })
}

/// A parameter in force; no number for a place without a parameter, and before the start.
///
/// # Safety
/// `session` is null or from [`masseter_attach`].
#[unsafe(no_mangle)]
pub unsafe extern "C" fn masseter_parameter(session: *const MasseterSession, parameter: c_int) -> f64 {
    // SAFETY: as this function's.
    let session = unsafe { session.as_ref() };
    let place = usize::try_from(parameter).ok();
    let value = session.zip(place).and_then(|(session, place)| match &session.stage {
        Stage::Started(session) => session.parameters().get(place).copied(),
        Stage::Attached(_) | Stage::Over => None,
    });
    value.unwrap_or(f64::NAN)
}

/// Gives a signal its value of this cycle.
///
/// # Safety
/// `session` is null or from [`masseter_attach`].
#[unsafe(no_mangle)]
pub unsafe extern "C" fn masseter_set_signal(
    session: *mut MasseterSession,
    signal: c_int,
    value: f64,
) -> c_int {
    guarded(|| {
        // SAFETY: as this function's.
        let session = unsafe { session.as_mut() }.ok_or(NULL)?.started()?;
        let place = usize::try_from(signal).ok().and_then(|place| session.signals_mut().get_mut(place));
        *place.ok_or(Failure::of("no signal of this place is declared"))? = value;
        Ok(OK)
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
        let (session, reason) = unsafe { (owned(session)?, lossy(reason)) };
        if let Stage::Started(session) = session.stage {
            session.fail(&reason)?;
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
        let law = CLaw::new(law.ok_or(NULL)?, user, session.declared);
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

/// Three strings of C; empty ones for null.
///
/// # Safety
/// Each is null or ends with a zero.
unsafe fn texts(given: [*const c_char; 3]) -> Result<[String; 3], Failure> {
    let mut texts = [const { String::new() }; 3];
    for (text, given) in texts.iter_mut().zip(given) {
        // SAFETY: as this function's.
        unsafe { self::text(given) }?.unwrap_or_default().clone_into(text);
    }
    Ok(texts)
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

/// The reason of an end, which must be reported whatever the bytes are.
///
/// # Safety
/// `text` is null or ends with a zero.
unsafe fn lossy<'a>(text: *const c_char) -> Cow<'a, str> {
    if text.is_null() {
        return "no reason is given".into();
    }
    // SAFETY: as this function's.
    unsafe { CStr::from_ptr(text) }.to_string_lossy()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_reason_that_is_no_utf_8_is_a_reason_all_the_same() {
        for (given, expected) in [(c"over", "over"), (c"\xff over", "\u{fffd} over"), (c"", "")] {
            // SAFETY: strings of C.
            assert_eq!(unsafe { lossy(given.as_ptr()) }, expected);
        }
        // SAFETY: null is allowed.
        assert_eq!(unsafe { lossy(std::ptr::null()) }, "no reason is given");
    }
}
