"""The terminal behind which a simulated board waits."""

import pytest

from thermoctl.app.simulate import terminal


def test_a_link_in_a_folder_that_is_not_there_is_refused_by_its_own_name(tmp_path):
    link = tmp_path / "nowhere" / "board"
    with pytest.raises(FileNotFoundError) as refused, terminal(link):
        pass
    assert refused.value.filename == str(link)


def test_a_file_that_is_no_link_is_left_alone(tmp_path):
    link = tmp_path / "board"
    link.write_text("mine")
    with pytest.raises(FileExistsError) as refused, terminal(link):
        pass
    assert refused.value.filename == str(link)
    assert link.read_text() == "mine"
