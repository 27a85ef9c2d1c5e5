//! What every message has, and the macro that makes a message of its fields. The messages themselves are in the
//! [parent module](super).

use bytemuck::Pod;
use iceoryx2::prelude::ZeroCopySend;

use super::schema::{self, Field};

/// The type of the messages of a topic.
pub trait Message: Pod + ZeroCopySend + Default + std::fmt::Debug + PartialEq {
    /// The topic the message travels on.
    const TOPIC: &'static str;
    /// Messages that a subscriber keeps; a slower subscriber loses the oldest ones.
    const DEPTH: usize;
    /// Type name in recordings.
    const TYPE_NAME: &'static str;
    /// Type name in shared memory, `masseter/Reading/<hash>`: a service of another layout is refused when it is opened. The
    /// hash covers the schema, the version, and the number and name of every code that messages carry.
    const SHARED_MEMORY_NAME: &'static str;
    /// [`LAYOUT_VERSION`] of the sender.
    fn version(&self) -> u64;
    /// What the message is.
    fn about() -> &'static str;
    /// The fields in order.
    fn fields() -> Vec<Field>;
    /// The layout in the ROS 2 message definition language.
    fn schema() -> String {
        schema::definition(&Self::fields())
    }
    /// The same with comments: meaning, units and the names of codes. Recordings carry it.
    fn definition() -> String {
        schema::commented(Self::about(), &Self::fields())
    }
    /// The CDR body: all bytes except the unused ones at the end.
    fn body(&self) -> &[u8];
    /// The message with this body; none when no message of this type has such a body.
    fn from_body(body: &[u8]) -> Option<Self>;
    /// Stamps sequence number, time and version just before it is sent.
    fn stamp(&mut self, seq: u64, published_ns: u64);
}

/// Version of the layouts of all messages; it changes with any of them, and with what a field means.
pub const LAYOUT_VERSION: u64 = 14;

macro_rules! messages {
    ($($(#[doc = $doc:literal])* $name:ident on $topic:literal keeping $depth:literal as $type_name:tt {
        $($(#[doc = $field_doc:literal])* $field:ident: $type:ty,)*
    })*) => {$(
        $(#[doc = $doc])*
        #[repr(C)]
        #[derive(Debug, Clone, Copy, PartialEq, Pod, Zeroable, ZeroCopySend)]
        #[type_name($type_name)]
        pub struct $name {
            /// Number of this message on its topic, from 1.
            pub seq: u64,
            /// When it was published, ns.
            pub published_ns: u64,
            /// [`LAYOUT_VERSION`] of the sender.
            pub version: u64,
            $($(#[doc = $field_doc])* pub $field: $type,)*
        }

        impl Default for $name {
            /// All zeros.
            fn default() -> Self {
                Self::zeroed()
            }
        }

        impl Message for $name {
            const TOPIC: &'static str = $topic;
            const DEPTH: usize = $depth;
            const TYPE_NAME: &'static str = concat!("masseter/", stringify!($name));
            const SHARED_MEMORY_NAME: &'static str = $type_name;

            fn version(&self) -> u64 {
                self.version
            }

            fn about() -> &'static str {
                concat!($($doc),*)
            }

            fn fields() -> Vec<Field> {
                vec![
                    Field::new::<u64>("seq", offset_of!(Self, seq), " Number of this message on its topic, from 1."),
                    Field::new::<u64>("published_ns", offset_of!(Self, published_ns), " When it was published, ns."),
                    Field::new::<u64>("version", offset_of!(Self, version), " Version of the sender's layouts."),
                    $(Field::new::<$type>(
                        stringify!($field),
                        offset_of!(Self, $field),
                        concat!($($field_doc),*),
                    ),)*
                ]
            }

            fn body(&self) -> &[u8] {
                let unused = 0 $(+ self.$field.unused_bytes())*;
                &bytes_of(self)[..size_of::<Self>() - unused]
            }

            fn from_body(body: &[u8]) -> Option<Self> {
                let mut message = Self::default();
                bytes_of_mut(&mut message).get_mut(..body.len())?.copy_from_slice(body);
                (message.body().len() == body.len()).then_some(message)
            }

            fn stamp(&mut self, seq: u64, published_ns: u64) {
                (self.seq, self.published_ns, self.version) = (seq, published_ns, LAYOUT_VERSION);
            }
        }
    )*};
}

pub(super) use messages;
