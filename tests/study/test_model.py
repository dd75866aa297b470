"""Skeleton models: the shipped ones, their relation to the paper's tables, and refusals."""

from pathlib import Path

import pytest

from shukotsu.errors import InputError
from shukotsu.study.config_files import shipped_names
from shukotsu.study.model import read_model


@pytest.mark.parametrize("name", shipped_names("model"))
def test_every_shipped_model_is_read(name: str) -> None:
    model = read_model(name)
    assert model.name == name
    assert model.description


def test_each_table_of_the_paper_has_its_model() -> None:
    """The models of the paper's four tables differ in the expected settings."""
    tables = {
        model.paper_table: model for model in map(read_model, shipped_names("model")) if model.paper_table
    }
    told_apart = {n: (m.metacarpals.unmeasured, m.own_cmc, m.planes.corrections) for n, m in tables.items()}
    assert told_apart == {
        1: ("rest", (), False),
        2: ("estimated", (), False),
        3: ("estimated", ("thumb_cmc",), False),
        4: ("estimated", ("thumb_cmc",), True),
    }


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("model: yours\ndescription: d", "model: is 'yours'; expected the name of the file, 'mine'"),
        ("model: mine\ndescription: d\nmetacarpals: {rest_direction: [0, 0, 0]}",
         "metacarpals.rest_direction: has no length"),
        ("model: mine", "the key 'description' is missing"),
        ("model: mine\ndescription: d\njoints: {solver: anatomical}",
         "joints.solver: is 'anatomical'; expected one of"),
        ("model: mine\ndescription: d\nplanes: {cut: false, corrections: true}",
         "planes.corrections: is true, but planes.cut: false makes centres final"),
        ("model: mine\ndescription: d\nmetacarpals: {unmeasured: fitted}",
         "metacarpals.unmeasured: is fitted, but no whole hand is fitted"),
        ("model: mine\ndescription: d\nfit: {whole_hand: true}",
         "planes.cut: is true; a fit of the whole hand places its joints itself"),
        ("model: mine\ndescription: d\nfit: {whole_hand: true}\nplanes: {cut: false}",
         "metacarpals: a fit of the whole hand poses them all"),
    ],
)  # fmt: skip
def test_a_contradictory_model_is_refused(tmp_path: Path, text: str, message: str) -> None:
    (tmp_path / "mine.yaml").write_text(text)
    with pytest.raises(InputError, match=message):
        read_model("mine.yaml", tmp_path)
    with pytest.raises(InputError, match="did you mean 'rigid'"):
        read_model("ridgid", tmp_path)
