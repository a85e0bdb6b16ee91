"""Facts about the one place that knows which array library is in use."""

import numpy as np
import pytest

import gonio as gn
from gonio.arrays import floats, frozen, is_numpy, like, namespace, require_finite, to_numpy


def test_lists_and_numbers_adapt_to_the_array_beside_them():
    _, a, b, c = floats([1, 2, 3], np.zeros(3, np.float32), 0.5)
    assert {x.dtype for x in (a, b, c)} == {np.dtype(np.float32)}
    assert {x.dtype for x in floats([1, 2], 3)[1:]} == {np.dtype(np.float64)}


@pytest.mark.parametrize(
    ("dtypes", "kept"),
    [
        ((np.float32, np.float64), np.float64),
        ((np.float16,), np.float32),  # no sum survives in half precision
        ((np.int64,), np.float64),
        ((np.int32, np.float32), np.float32),
    ],
)
def test_the_widest_floating_dtype_is_kept(dtypes, kept):
    assert all(x.dtype == kept for x in floats(*(np.ones(2, d) for d in dtypes))[1:])


def test_a_numpy_scalar_is_a_number_and_no_array():
    _, a, b = floats(np.float64(2), np.zeros(2, np.float32))
    assert a.dtype == b.dtype == np.float32


@pytest.mark.parametrize("value", [1j, "seven", [1, "two"], np.array([1 + 2j]), [[1, 2], [3]]])
def test_what_is_no_real_number_is_refused(value):
    with pytest.raises(gn.GonioError, match="real numbers"):
        floats(value)


def test_the_first_value_that_is_not_finite_is_named():
    with pytest.raises(gn.GonioError, match=r"light\[1, 0\] is inf"):
        require_finite(np.array([[0.0, 1.0], [np.inf, np.nan]]), "light")


def test_what_a_model_holds_cannot_be_changed_from_outside():
    mine = np.array([1.0, 2.0])
    held = frozen(mine)
    mine[0] = 9
    assert held[0] == 1
    with pytest.raises(ValueError, match="read-only"):
        held[0] = 5


def test_what_nobody_can_change_is_held_without_a_copy():
    held = frozen(np.array([1.0, 2.0]))
    assert frozen(held) is held
    assert frozen(held, np.float32) is not held
    view = np.array([1.0, 2.0])[:]
    view.flags.writeable = False
    assert frozen(view) is not view  # whoever has the array below it may write there


def test_tensors_keep_library_dtype_device_and_gradient():
    torch = pytest.importorskip("torch")
    x = torch.tensor([1.0, 2.0], requires_grad=True)
    xp, a, b = floats(x, 3)
    assert isinstance(b, torch.Tensor)
    assert a.dtype == b.dtype == torch.float32
    assert xp is namespace(x)
    assert not is_numpy(x, np.zeros(1))
    assert is_numpy(np.zeros(1), [1.0])
    like(x, torch.zeros(1, dtype=torch.float64)).sum().backward()
    assert x.grad is not None
    np.testing.assert_array_equal(to_numpy(x), [1, 2])


def test_two_libraries_are_not_mixed():
    torch = pytest.importorskip("torch")
    with pytest.raises(gn.GonioError, match="numpy and torch are mixed"):
        floats(np.zeros(3), torch.zeros(3))
