//! `/dev/cpu_dma_latency`: an open file with the value 0 disables the idle states of all cores.

use std::fs::{File, OpenOptions};
use std::io::{self, Read, Seek, Write};

use masseter_recording::DmaLatency;
use masseter_scenario::CpuDmaLatency;

/// The kernel's device.
pub const DEVICE: &str = "/dev/cpu_dma_latency";

/// Keeps the device open, if configured, until dropped.
#[derive(Debug)]
pub struct Hold {
    /// The result, for the manifest.
    pub obtained: DmaLatency,
    _device: Option<File>,
}

impl Hold {
    /// Opens the device if `requested` demands that for this kind of machine.
    pub fn new(requested: CpuDmaLatency, is_virtual: bool) -> Self {
        let opened = is_to_be_held(requested, is_virtual).then(open_device);
        let (device, limit_us, refusal) = match opened {
            Some(Ok((device, limit_us))) => (Some(device), Some(limit_us), None),
            Some(Err(error)) if requested == CpuDmaLatency::Hold => {
                let refusal = format!(
                    "{DEVICE} refused ({error}): run as root, or allow it with 'sudo setfacl -m u:\"$USER\":rw {DEVICE}'"
                );
                (None, None, Some(refusal))
            }
            Some(Err(_)) | None => (None, None, None),
        };
        Self { obtained: DmaLatency { requested, limit_us, refusal }, _device: device }
    }
}

fn is_to_be_held(requested: CpuDmaLatency, is_virtual: bool) -> bool {
    match requested {
        CpuDmaLatency::Auto => !is_virtual,
        CpuDmaLatency::Hold => true,
        CpuDmaLatency::Leave => false,
    }
}

/// Writes a latency of 0 µs, in native byte order, and reads the limit back.
fn open_device() -> io::Result<(File, i32)> {
    let mut device = OpenOptions::new().read(true).write(true).open(DEVICE)?;
    device.write_all(&0_i32.to_ne_bytes())?;
    device.rewind()?;
    let mut limit_us = [0; 4];
    device.read_exact(&mut limit_us)?;
    Ok((device, i32::from_ne_bytes(limit_us)))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_virtual_machine_uses_the_device_only_if_configured() {
        let cases = [
            (CpuDmaLatency::Auto, false, true),
            (CpuDmaLatency::Auto, true, false),
            (CpuDmaLatency::Hold, true, true),
            (CpuDmaLatency::Leave, false, false),
        ];
        for (requested, is_virtual, expected) in cases {
            assert_eq!(is_to_be_held(requested, is_virtual), expected, "{requested:?} {is_virtual}");
        }
    }

    #[test]
    fn a_device_that_is_not_requested_is_neither_opened_nor_refused() {
        let hold = Hold::new(CpuDmaLatency::Leave, false);
        assert_eq!((hold.obtained.limit_us, &hold.obtained.refusal), (None, &None));
    }
}
