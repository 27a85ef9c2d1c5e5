"""Kinds of drives as settings, and the names of quirks and faults.

A profile has the identity of a vendor's drive and its known deviations. The object dictionary stays that of the emulated drives.
"""

from typing import Any, Literal

QuirkKind = Literal[
    "factory_pdos", "narrow_limits", "acceleration_in_rpm_s", "interpolation_in_ms", "missing_objects",
    "pdos_locked_in_operation", "two_boot_ups", "slow_save", "slow_brake", "no_brake", "home_offset_sign",
    "limits_from_zero", "sto_at_power_on", "incremental_encoder", "second_encoder", "fault_at_power_on", "restarts",
    "ignores_heartbeat", "ignores_process_data", "late_watchdog", "coasts_without_master", "creeps", "shows", "lacks",
]  # fmt: skip

FaultKind = Literal[
    "fault", "ignores_targets", "torque_loss", "runaway", "sto", "slow_enable", "brake_open", "brake_closed", "reboot",
    "scale", "emcy_storm",
]  # fmt: skip

PROFILES: dict[str, dict[str, Any]] = {
    "emulated": {},
    "epos4": {
        "identity": {
            "device_type": 0x0002_0192,
            "vendor_id": 0x0000_00FB,
            "product_code": 0x6552_0000,
            "revision": 0x0170_0000,
        },
        "quirks": [
            "narrow_limits",
            "interpolation_in_ms",
            {"kind": "acceleration_in_rpm_s", "increments_per_turn": 10_000},
            {"kind": "lacks", "object": (0x607C, 0)},
        ],
    },
    "n5": {
        "identity": {"device_type": 0x0004_0192, "vendor_id": 0x0000_026C, "product_code": 0, "revision": 0},
        "quirks": ["interpolation_in_ms", {"kind": "slow_save", "for_s": 2.0}],
    },
}
