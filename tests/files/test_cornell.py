"""Cornell's scattered measurements: the real paints, and files that are broken."""

import numpy as np
import pytest

import gonio as gn
from gonio.directions import from_spherical
from gonio.errors import FileError
from gonio.files.cornell import read_cornell

LINE = "0.5 0 0.7 {phi} " + " ".join(["0.2"] * 31)
HEAD = "# num wls\n31\n" + " ".join(str(k) for k in range(400, 701, 10)) + "\n"
BODY = "\n".join(LINE.format(phi=0.1 * k) for k in range(20))


def test_a_written_file_is_read_as_it_was_meant(tmp_path):
    path = tmp_path / "gray.brdf"
    path.write_text(HEAD + "# samples\n" + BODY)
    brdf = read_cornell(path)
    assert np.allclose(brdf.values, 0.2)
    assert np.allclose(brdf.wi, from_spherical(0.5, 0.0))
    assert np.allclose(brdf.wo[3], from_spherical(0.7, 0.3))
    assert brdf.f(brdf.wi[0], brdf.wo[0]) == pytest.approx([0.2] * 3, rel=1e-6)


@pytest.mark.parametrize(("name", "channel"), [("acryl_blue", 2), ("garnet_red", 0), ("krylon_blue", 2)])
def test_measured_paints_have_the_colour_of_their_names(data, name, channel):
    brdf = read_cornell(data / "brdf" / "cornell" / f"{name}.brdf")
    assert brdf.values.shape == (1439, 3)
    # Away from the mirror direction a paint shows its pigment.
    f = gn.read_brdf(data / "brdf" / "cornell" / f"{name}.brdf").f(from_spherical(0.5, 0.0), from_spherical(0.3, 1.5))
    assert np.argmax(f) == channel
    assert f[channel] > 1.5 * np.delete(f, channel).max()


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("", "number of wavelengths is 0"),
        ("analytic\n", "numbers only"),
        ("1e9 1 2 3", "number of wavelengths is 1e"),
        ("nan 1 2 3", "number of wavelengths is nan"),
        ("2.5 1 2 3", "number of wavelengths is 2.5"),
        ("31 400 410", "cut short"),
        (HEAD, "cut short"),
        (HEAD + BODY[:-5], "cut short"),
        (HEAD + BODY.replace("0.7 ", "nan ", 1), "sample 0"),
        (HEAD + BODY.replace("0.7 ", "70 ", 1), "theta runs"),
        (HEAD + BODY.replace("0.2", "-0.2", 1), "not negative"),
        (HEAD.replace("500", "900") + BODY, "rising"),
        (HEAD + "\n".join(BODY.split("\n")[:10]), "expected"),
    ],
)
def test_broken_files_are_refused_by_name(tmp_path, text, message):
    path = tmp_path / "broken.brdf"
    path.write_text(text)
    with pytest.raises(FileError, match=rf"broken\.brdf: .*{message}"):
        read_cornell(path)


def test_binary_and_missing_files_are_refused(tmp_path):
    path = tmp_path / "binary.brdf"
    path.write_bytes(b"\xff\xfe\x00")
    with pytest.raises(FileError, match="plain text"):
        read_cornell(path)
    with pytest.raises(FileError, match=r"none\.brdf"):
        read_cornell(tmp_path / "none.brdf")
