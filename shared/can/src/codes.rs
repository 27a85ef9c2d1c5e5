//! Enumerations with fixed numbers and names.

/// Declares enumerations with the number and the name of every value.
#[macro_export]
macro_rules! codes {
    ($($(#[$doc:meta])* $name:ident as $number:ident {
        $($(#[$variant_doc:meta])* $variant:ident = $code:literal $text:literal,)*
    })*) => {$(
        $(#[$doc])*
        #[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
        #[repr($number)]
        pub enum $name {
            $($(#[$variant_doc])* $variant = $code,)*
        }

        impl $name {
            /// Every value, in the order of declaration.
            pub const ALL: [Self; [$($code),*].len()] = [$(Self::$variant),*];

            /// The number of the value.
            pub const fn code(self) -> $number {
                self as $number
            }

            /// The value with that number.
            pub fn from_code(code: $number) -> Option<Self> {
                Self::ALL.into_iter().find(|value| value.code() == code)
            }

            /// The name in files and reports.
            pub const fn name(self) -> &'static str {
                match self {
                    $(Self::$variant => $text,)*
                }
            }
        }

        /// An unknown number is handed back.
        impl TryFrom<$number> for $name {
            type Error = $number;

            fn try_from(code: $number) -> Result<Self, $number> {
                Self::from_code(code).ok_or(code)
            }
        }

        impl std::fmt::Display for $name {
            fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
                f.pad(self.name())
            }
        }
    )*};
}
