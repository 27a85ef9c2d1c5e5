"""fk and ik over arrays."""

from pathlib import Path

import numpy as np
import pytest

import masseter


def motion(rows: int) -> np.ndarray:
    time_s = np.linspace(0.0, 3.0, rows)[:, None]
    return np.array([0, 0, 0, 0.27, 0.27, 0.27]) + 0.003 * np.sin(time_s * np.arange(1, 7))


def test_ik_is_the_inverse_of_fk_for_every_shape() -> None:
    for shape in [(6,), (1, 6), (50, 6), (5, 10, 6), (0, 6)]:
        positions_m = motion(50)[: int(np.prod(shape[:-1]))].reshape(shape)
        position_m, quaternion_wxyz = masseter.fk(positions_m)
        assert position_m.shape == (*shape[:-1], 3) and quaternion_wxyz.shape == (*shape[:-1], 4)
        assert np.allclose(masseter.ik(position_m, quaternion_wxyz), positions_m, rtol=0, atol=1e-12)


def test_the_order_of_rows_does_not_matter() -> None:
    positions_m = motion(500)
    order = np.random.default_rng(1).permutation(500)
    in_order, _ = masseter.fk(positions_m)
    shuffled, _ = masseter.fk(positions_m[order])
    assert np.allclose(shuffled, in_order[order], rtol=0, atol=1e-12)


def test_a_bad_row_is_named_with_the_reason() -> None:
    positions_m = motion(10)
    positions_m[7, 2] = np.nan
    with pytest.raises(masseter.MasseterError, match="row 7: .*not a finite number"):
        masseter.fk(positions_m)
    positions_m[7] = [0.03, -0.03, 0.0, 0.3, 0.24, 0.24]
    with pytest.raises(masseter.MasseterError, match="row 7: .*cannot be assembled"):
        masseter.fk(positions_m)
    with pytest.raises(masseter.MasseterError, match="row 0: the quaternion has the length 0.5"):
        masseter.ik([0, 0, 0.27], [0.5, 0, 0, 0])
    with pytest.raises(ValueError, match=r"shape \(5,\)"):
        masseter.fk([0.0] * 5)


def test_the_mechanism_of_a_scenario_is_used(tmp_path: Path) -> None:
    scenario = tmp_path / "large.toml"
    scenario.write_text("[mechanism]\nplatform_sides_m = [0.11, 0.11, 0.11]\n")
    large = masseter.Mechanism(scenario)
    positions_m = motion(1)
    position_m, quaternion_wxyz = masseter.fk(positions_m, large)
    assert np.abs(position_m - masseter.fk(positions_m)[0]).max() > 1e-4
    assert np.allclose(masseter.ik(position_m, quaternion_wxyz, large), positions_m, rtol=0, atol=1e-12)
    with pytest.raises(masseter.MasseterError, match="nowhere.toml"):
        masseter.Mechanism("nowhere.toml")
