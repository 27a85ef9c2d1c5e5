//! The rig's interface for controllers in C and C++; `rig/bindings/interface/masseter.h` documents every function.
//!
//! Each function returns a result and keeps its message for [`masseter_error`]. No panic leaves this library: it
//! becomes an error. A session belongs to the thread that attached. A reference that may be absent is a pointer in C,
//! which is null or valid for the call. A boxed session is one from [`masseter_attach`], which C does not use again.
#![allow(unsafe_code, reason = "C passes pointers")]

mod law;
mod robot;

use std::ffi::{CStr, CString, c_char, c_int, c_void};
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::{borrow::Cow, cell::RefCell, time::Duration};

use masseter_controller::{process, robot_model::RobotModel};
use masseter_runtime::control::{Outcome, Session, Tick, Waited};
use masseter_runtime::lifecycle::attach::attach;
use masseter_runtime::messages::{Command, Event, Reading, State};
use masseter_runtime::named::{Declared, Parameter, PlayedMotion, Signal};

use law::{LawFunction, law_of_c};

const OK: c_int = 0;
const TIMED_OUT: c_int = 1;
const SAFE_STOP: c_int = 2;
const ERROR: c_int = -1;

const NULL: Failure = Failure::of("a pointer is null");

thread_local! {
    /// The message of the last error of the thread; empty before the first.
    static MESSAGE: RefCell<CString> = RefCell::default();
}

/// Why a function failed.
struct Failure(Cow<'static, str>);

impl Failure {
    const fn of(text: &'static str) -> Self {
        Self(Cow::Borrowed(text))
    }
}

impl<E: std::error::Error> From<E> for Failure {
    fn from(error: E) -> Self {
        Self(Cow::Owned(error.to_string()))
    }
}

/// The result of `work`. A panic is an error, since it must not unwind through C.
fn guarded(work: impl FnOnce() -> Result<c_int, Failure>) -> c_int {
    let Failure(text) = match catch_unwind(AssertUnwindSafe(work)) {
        Ok(Ok(result)) => return result,
        Ok(Err(failure)) => failure,
        Err(_) => Failure::of("a fault of Masseter itself; standard error has its place"),
    };
    MESSAGE.set(CString::new(text.replace('\0', " ")).unwrap_or_default());
    ERROR
}

/// An attached program.
#[derive(Debug)]
pub struct MasseterSession {
    stage: Stage,
    period_ns: u64,
    declared: Declared,
    /// None before the first question to it, at the latest before the start.
    robot: Option<RobotModel>,
    /// The scenario as text; none before the first question to it.
    text: Option<CString>,
}

#[derive(Debug)]
enum Stage {
    Attached(Box<masseter_runtime::lifecycle::ProcessContext>),
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
    /// Adds to the declarations before the start; `add` returns how many there are then. Returns the place of the last.
    fn declare(&mut self, add: impl FnOnce(&mut Declared) -> usize) -> Result<c_int, Failure> {
        let Stage::Attached(_) = self.stage else {
            return Err(Failure::of("the session is started: declare before"));
        };
        let mut declared = self.declared.clone();
        let count = add(&mut declared);
        declared.check()?;
        self.declared = declared;
        Ok(c_int::try_from(count).expect("a few are accepted") - 1)
    }

    fn scenario(&self) -> Result<&masseter_scenario::Scenario, Failure> {
        match &self.stage {
            Stage::Attached(context) => Ok(&context.scenario),
            Stage::Started(session) => Ok(&session.context().scenario),
            Stage::Over => Err(Failure::of("the session has no scenario: its start has failed")),
        }
    }

    /// The robot of the scenario.
    fn robot(&mut self) -> Result<&mut RobotModel, Failure> {
        let robot = match self.robot.take() {
            Some(robot) => robot,
            None => RobotModel::new(self.scenario()?)?,
        };
        Ok(self.robot.insert(robot))
    }

    fn started(&mut self) -> Result<&mut Session, Failure> {
        match &mut self.stage {
            Stage::Started(session) => Ok(session),
            Stage::Attached(_) | Stage::Over => {
                Err(Failure::of("the session is not started: call masseter_start first"))
            }
        }
    }
}

/// The message of the last error in this thread; it lasts until the next call.
#[unsafe(no_mangle)]
pub extern "C" fn masseter_error() -> *const c_char {
    MESSAGE.with_borrow(|message| message.as_ptr())
}

/// Attaches to a rig.
///
/// # Safety
/// `rig` is null or a string.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn masseter_attach(
    rig: *const c_char,
    session: Option<&mut *mut MasseterSession>,
) -> c_int {
    guarded(|| {
        // SAFETY: as this function's.
        let context = attach(unsafe { text_of(rig) }?)?;
        let period_ns = context.scenario.period_ns();
        let stage = Stage::Attached(Box::new(context));
        let declared = Declared::default();
        let attached = MasseterSession { stage, period_ns, declared, robot: None, text: None };
        *session.ok_or(NULL)? = Box::into_raw(Box::new(attached));
        Ok(OK)
    })
}

/// Opens the ports, reports ready, waits for the start.
#[unsafe(no_mangle)]
pub extern "C" fn masseter_start(session: Option<&mut MasseterSession>) -> c_int {
    guarded(|| {
        let session = session.ok_or(NULL)?;
        // In real time no cycle waits for it.
        session.robot()?;
        match std::mem::replace(&mut session.stage, Stage::Over) {
            Stage::Attached(context) => {
                let declared = std::mem::take(&mut session.declared);
                session.stage = Stage::Started(Box::new(Session::start(*context, declared)?));
                Ok(OK)
            }
            stage => {
                session.stage = stage;
                Err(Failure::of("the session is started already"))
            }
        }
    })
}

/// Declares a signal; returns its place.
///
/// # Safety
/// The texts are null or strings.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn masseter_declare_signal(
    session: Option<&mut MasseterSession>,
    name: *const c_char,
    unit: *const c_char,
    about: *const c_char,
) -> c_int {
    guarded(|| {
        // SAFETY: as this function's.
        let [name, unit, about] = unsafe { texts([name, unit, about]) }?;
        session.ok_or(NULL)?.declare(|declared| {
            declared.signals.push(Signal { name, unit, about });
            declared.signals.len()
        })
    })
}

/// Declares a parameter; returns its place.
///
/// # Safety
/// The texts are null or strings.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn masseter_declare_parameter(
    session: Option<&mut MasseterSession>,
    name: *const c_char,
    unit: *const c_char,
    about: *const c_char,
    value: f64,
    least: f64,
    most: f64,
) -> c_int {
    guarded(|| {
        // SAFETY: as this function's.
        let [name, unit, about] = unsafe { texts([name, unit, about]) }?;
        session.ok_or(NULL)?.declare(|declared| {
            declared.parameters.push(Parameter { name, unit, about, value, range: [least, most] });
            declared.parameters.len()
        })
    })
}

/// Declares that the controller plays a motion of its own, not the scenario's.
#[unsafe(no_mangle)]
pub extern "C" fn masseter_declare_own_motion(session: Option<&mut MasseterSession>) -> c_int {
    guarded(|| {
        session.ok_or(NULL)?.declare(|declared| {
            declared.motion = PlayedMotion::Own;
            1
        })
    })
}

/// A parameter in force; no number for a place without a parameter, and before the start.
#[unsafe(no_mangle)]
pub extern "C" fn masseter_parameter(session: Option<&MasseterSession>, parameter: c_int) -> f64 {
    let Some(Stage::Started(session)) = session.map(|session| &session.stage) else { return f64::NAN };
    let place = usize::try_from(parameter).ok();
    place.and_then(|place| session.parameters().get(place).copied()).unwrap_or(f64::NAN)
}

/// Gives a signal its value of this cycle.
#[unsafe(no_mangle)]
pub extern "C" fn masseter_set_signal(
    session: Option<&mut MasseterSession>,
    signal: c_int,
    value: f64,
) -> c_int {
    guarded(|| {
        let session = session.ok_or(NULL)?.started()?;
        let place = usize::try_from(signal).ok().and_then(|place| session.signals_mut().get_mut(place));
        *place.ok_or(Failure::of("no signal of this place is declared"))? = value;
        Ok(OK)
    })
}

/// Time from one cycle to the next, ns; 0 without a session.
#[unsafe(no_mangle)]
pub extern "C" fn masseter_period_ns(session: Option<&MasseterSession>) -> u64 {
    session.map_or(0, |session| session.period_ns)
}

/// Waits for the next cycle.
#[unsafe(no_mangle)]
pub extern "C" fn masseter_wait(
    session: Option<&mut MasseterSession>,
    timeout_ns: i64,
    cycle: Option<&mut MasseterCycle>,
    reading: Option<&mut Reading>,
) -> c_int {
    guarded(|| {
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
#[unsafe(no_mangle)]
pub extern "C" fn masseter_publish(
    session: Option<&mut MasseterSession>,
    command: Option<&Command>,
    state: Option<&State>,
) -> c_int {
    guarded(|| {
        session.ok_or(NULL)?.started()?.publish(command.ok_or(NULL)?, state.ok_or(NULL)?)?;
        Ok(OK)
    })
}

/// Publishes an event.
#[unsafe(no_mangle)]
pub extern "C" fn masseter_publish_event(
    session: Option<&mut MasseterSession>,
    event: Option<&Event>,
) -> c_int {
    guarded(|| {
        session.ok_or(NULL)?.started()?.publish_event(event.ok_or(NULL)?)?;
        Ok(OK)
    })
}

/// 1 once the rig wants an orderly end.
#[unsafe(no_mangle)]
pub extern "C" fn masseter_is_stop_requested(session: Option<&MasseterSession>) -> c_int {
    match session.map(|session| &session.stage) {
        Some(Stage::Started(session)) => c_int::from(session.is_stop_requested()),
        Some(Stage::Attached(context)) => c_int::from(context.stop.is_made()),
        Some(Stage::Over) | None => 1,
    }
}

/// Ends the work in order, and frees the session.
#[unsafe(no_mangle)]
pub extern "C" fn masseter_finish(session: Option<Box<MasseterSession>>, is_safe_stop: c_int) -> c_int {
    let outcome = if is_safe_stop == 0 { Outcome::Finished } else { Outcome::SafeStop };
    guarded(|| match session.ok_or(NULL)?.stage {
        Stage::Started(session) => Ok(session.finish(outcome).map(|()| OK)?),
        Stage::Attached(_) | Stage::Over => Err(Failure::of("the session is not started")),
    })
}

/// Ends the work with a reason, and frees the session.
///
/// # Safety
/// `reason` is null or a string.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn masseter_fail(
    session: Option<Box<MasseterSession>>,
    reason: *const c_char,
) -> c_int {
    guarded(|| {
        if let Stage::Started(session) = session.ok_or(NULL)?.stage {
            // SAFETY: as this function's.
            session.fail(&unsafe { reason_of(reason) })?;
        }
        Ok(OK)
    })
}

/// Runs the rig's own controller with a pose law, to its end, and frees the session.
///
/// # Safety
/// `law` may be called with `user` until this returns.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn masseter_run(
    session: Option<Box<MasseterSession>>,
    law: Option<LawFunction>,
    user: *mut c_void,
) -> c_int {
    guarded(|| {
        let session = session.ok_or(NULL)?;
        let law = law_of_c(law.ok_or(NULL)?, user, session.declared);
        let Stage::Attached(context) = session.stage else {
            let remedy = "the session is started already: call masseter_run instead of masseter_start";
            return Err(Failure::of(remedy));
        };
        Ok(match process::run_with_law(*context, Box::new(law))? {
            Outcome::Finished => OK,
            Outcome::SafeStop => SAFE_STOP,
        })
    })
}

/// Three strings of C; empty ones for null.
///
/// # Safety
/// Each is null or ends with a zero.
unsafe fn texts(given: [*const c_char; 3]) -> Result<[String; 3], Failure> {
    // SAFETY: as this function's.
    let [name, unit, about] = given.map(|text| unsafe { text_of(text) });
    Ok([name?, unit?, about?].map(|text| text.unwrap_or_default().to_owned()))
}

/// A string of C; none for null.
///
/// # Safety
/// `text` is null or ends with a zero.
unsafe fn text_of<'a>(text: *const c_char) -> Result<Option<&'a str>, Failure> {
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
unsafe fn reason_of<'a>(text: *const c_char) -> Cow<'a, str> {
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
            assert_eq!(unsafe { reason_of(given.as_ptr()) }, expected);
        }
        // SAFETY: null is allowed.
        assert_eq!(unsafe { reason_of(std::ptr::null()) }, "no reason is given");
    }
}
