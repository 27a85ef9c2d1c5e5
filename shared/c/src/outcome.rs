//! Results of C functions: a number, and the message of an error until the next error of the thread.

use std::borrow::Cow;
use std::cell::RefCell;
use std::ffi::{CString, c_char, c_int};
use std::fmt::Display;
use std::panic::{AssertUnwindSafe, catch_unwind};

pub(crate) const OK: c_int = 0;
pub(crate) const TIMED_OUT: c_int = 1;
pub(crate) const SAFE_STOP: c_int = 2;
const ERROR: c_int = -1;

thread_local! {
    static MESSAGE: RefCell<CString> = RefCell::default();
}

/// Why a function failed.
pub(crate) struct Failure(Cow<'static, str>);

impl Failure {
    pub(crate) const fn of(text: &'static str) -> Self {
        Self(Cow::Borrowed(text))
    }
}

impl From<&'static str> for Failure {
    fn from(text: &'static str) -> Self {
        Self::of(text)
    }
}

macro_rules! failures {
    ($($error:ty),*) => {$(
        impl From<$error> for Failure {
            fn from(error: $error) -> Self {
                Self(Cow::Owned(error.to_string()))
            }
        }
    )*};
}

failures!(
    masseter_controller::process::ControllerError,
    masseter_runtime::control::SessionError,
    masseter_runtime::lifecycle::ProcessError,
    masseter_runtime::lifecycle::attach::AttachError,
    masseter_runtime::named::NameError
);

/// The result of `work`. A panic is an error, since it must not unwind through C.
pub(crate) fn guarded(work: impl FnOnce() -> Result<c_int, Failure>) -> c_int {
    match catch_unwind(AssertUnwindSafe(work)) {
        Ok(Ok(result)) => result,
        Ok(Err(Failure(text))) => keep(text),
        Err(_) => keep("a fault of Masseter itself; standard error has its place"),
    }
}

fn keep(text: impl Display) -> c_int {
    let text = text.to_string().replace('\0', " ");
    MESSAGE.with_borrow_mut(|message| *message = CString::new(text).unwrap_or_default());
    ERROR
}

/// The message of the last error in this thread; empty before the first.
pub(crate) fn message() -> *const c_char {
    MESSAGE.with_borrow(|message| message.as_ptr())
}
