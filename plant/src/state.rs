//! The state of a plant on its way into an [`Archive`] and back.
//!
//! A scenario builds a plant, and its cycles change the plant. Only the changed values are the state. The archive does
//! not hold the rest: mechanism, dictionaries, tables of pushes. So a state needs a plant of the same scenario.

use serde::{Serialize, de::DeserializeOwned};

/// The destination or the source of a state's values, one after the other.
pub trait Archive {
    /// A failed write or read of a value.
    type Error;

    /// Writes the value, or replaces the value by the read one.
    ///
    /// # Errors
    /// When there is no such value.
    fn value<T: Serialize + DeserializeOwned>(&mut self, value: &mut T) -> Result<(), Self::Error>;

    /// Binds the archive to a constant of the plant.
    ///
    /// # Errors
    /// When the archive has another constant.
    fn constant<T: Serialize>(&mut self, constant: &T) -> Result<(), Self::Error>;
}

/// The values that cycles change.
pub trait State {
    /// Exchanges the state with an archive. A read state replaces the whole old state.
    ///
    /// # Errors
    /// Those of the archive. A partly read state is useless.
    fn exchange<A: Archive>(&mut self, archive: &mut A) -> Result<(), A::Error>;
}

/// The state of a struct: fields that are values, and fields that have a state of their own. Of its constant fields,
/// an archive is bound to some. A field that is not named does not compile.
macro_rules! state {
    ($type:ty {
        $(values: $($value:ident)*;)?
        $(parts: $($part:ident)*;)?
        $(bound: $($bound:ident)*;)?
        $(constant: $($constant:ident)*;)?
    }) => {
        impl $crate::state::State for $type {
            fn exchange<A: $crate::state::Archive>(&mut self, archive: &mut A) -> Result<(), A::Error> {
                let Self { $($($value,)*)? $($($part,)*)? $($($bound,)*)? $($($constant: _,)*)? } = self;
                $($(archive.value($value)?;)*)?
                $($($crate::state::State::exchange($part, archive)?;)*)?
                $($(archive.constant($bound)?;)*)?
                Ok(())
            }
        }
    };
}
pub(crate) use state;

/// The parts that a scenario has, of which there are always as many.
impl<T: State> State for Vec<T> {
    fn exchange<A: Archive>(&mut self, archive: &mut A) -> Result<(), A::Error> {
        self.iter_mut().try_for_each(|part| part.exchange(archive))
    }
}

/// The part that a scenario has or lacks.
impl<T: State> State for Option<T> {
    fn exchange<A: Archive>(&mut self, archive: &mut A) -> Result<(), A::Error> {
        self.iter_mut().try_for_each(|part| part.exchange(archive))
    }
}
