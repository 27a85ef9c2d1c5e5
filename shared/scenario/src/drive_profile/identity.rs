//! Device type and identity object of a drive (1000h, 1018h).

section! {
    /// The identity that the master checks before it writes to a drive.
    #[derive(Copy, Eq)]
    pub struct IdentityConfig {
        /// Device type (object 1000).
        pub device_type: u32 = Self::EMULATED.device_type,
        /// Vendor (object 1018:01).
        pub vendor_id: u32 = Self::EMULATED.vendor_id,
        /// Product (object 1018:02).
        pub product_code: u32 = Self::EMULATED.product_code,
        /// The bits of the product code that must be equal.
        pub product_mask: u32 = u32::MAX,
        /// Revision (object 1018:03).
        pub revision: u32 = Self::EMULATED.revision,
        /// The bits of the revision that must be equal.
        pub revision_mask: u32 = u32::MAX,
    }
}

impl IdentityConfig {
    /// The emulated drives: servo drives of CiA 402. The vendor number is not registered with
    /// CiA.
    pub const EMULATED: Self = Self {
        device_type: 0x0002_0192,
        vendor_id: 0x004D_5354,
        product_code: 0x0000_0402,
        product_mask: u32::MAX,
        revision: 0x0001_0000,
        revision_mask: u32::MAX,
    };
}
