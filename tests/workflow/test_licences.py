"""The page of licences is that of today's lock, and no package is without one."""

from importlib import metadata

import pytest

from workflow import licences


def test_page_is_in_step() -> None:
    """`make docs` would change nothing."""
    assert licences.PAGE.read_text("utf-8") == licences.page(), "run `make docs`"


@pytest.mark.parametrize(
    ("stated", "expected"),
    [
        ("License-Expression: MIT\nLicense: other", "MIT"),
        ("License: BSD", "BSD"),
        (f"License: {'long text ' * 9}\nClassifier: License :: OSI Approved :: BSD License", "BSD License"),
        ("License: UNKNOWN", None),
        ("Classifier: Topic :: Software", None),
    ],
)
def test_a_package_without_a_licence_is_denied(
    stated: str,
    expected: str | None,
    tmp_path_factory: pytest.TempPathFactory,
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    folder = tmp_path_factory.mktemp("installed")
    (folder / "odd-1.dist-info").mkdir()
    (folder / "odd-1.dist-info" / "METADATA").write_text(f"Metadata-Version: 2.1\nName: odd\n{stated}\n")
    monkeypatch.syspath_prepend(str(folder))
    if expected is None:
        with pytest.raises(LookupError, match="odd: states no licence"):
            licences.licence("odd")
    else:
        assert licences.licence("odd") == expected
    with pytest.raises(metadata.PackageNotFoundError):
        licences.licence("nowhere")
