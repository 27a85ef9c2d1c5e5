//! Enumerations with fixed numbers and names.

/// A number that is no value of an enumeration.
#[derive(Debug, Clone, Copy, PartialEq, Eq, thiserror::Error)]
#[error("{enumeration} has no value with the number {number}")]
pub struct UnknownCode {
    /// Name of the enumeration.
    pub enumeration: &'static str,
    /// The number.
    pub number: u32,
}

/// Declares enumerations with the number and the name of every value.
#[macro_export]
macro_rules! codes {
    ($($(#[$doc:meta])* $name:ident as $number:ident {
        $($(#[doc = $variant_doc:literal])* $variant:ident = $code:literal $text:literal,)*
    })*) => {$(
        $(#[$doc])*
        #[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, serde::Serialize, serde::Deserialize)]
        #[repr($number)]
        pub enum $name {
            $($(#[doc = $variant_doc])* $variant = $code,)*
        }

        impl $name {
            /// Every value, in the order of declaration.
            pub const ALL: [Self; [$($code),*].len()] = [$(Self::$variant),*];

            /// The number of the value.
            #[inline]
            pub const fn code(self) -> $number {
                self as $number
            }

            /// The name in files and reports.
            pub const fn name(self) -> &'static str {
                match self {
                    $(Self::$variant => $text,)*
                }
            }

            /// What the value means.
            pub const fn about(self) -> &'static str {
                match self {
                    $(Self::$variant => concat!($($variant_doc),*),)*
                }
            }
        }

        impl TryFrom<$number> for $name {
            type Error = $crate::UnknownCode;

            #[inline]
            fn try_from(code: $number) -> Result<Self, Self::Error> {
                let unknown = $crate::UnknownCode { enumeration: stringify!($name), number: code.into() };
                Self::ALL.into_iter().find(|value| value.code() == code).ok_or(unknown)
            }
        }

        impl std::fmt::Display for $name {
            fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
                f.pad(self.name())
            }
        }
    )*};
}
