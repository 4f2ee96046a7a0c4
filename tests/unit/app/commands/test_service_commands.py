"""Times and durations as they are typed: those that no clock has are refused in words."""

import pytest
from click.testing import CliRunner

from thermoctl.app.cli import cli


@pytest.mark.parametrize("since", ["3000000d", "99999999999d", "9" * 400, "9999-12-31T23-12"])
def test_a_time_beyond_the_calendar_is_a_wrong_use(tmp_path, since):
    arguments = ["history", "export", "--file", str(tmp_path / "x"), "--since", since]
    result = CliRunner().invoke(cli, arguments)
    assert result.exit_code == 2, result.exception
    assert "expected an age such as 24h or a time such as" in result.stderr


@pytest.mark.parametrize("duration", ["9" * 400, f"{'9' * 308}d", "0", "-1", "nan", "1w"])
def test_a_duration_is_a_number_above_zero_with_a_unit_of_time(duration):
    result = CliRunner().invoke(cli, ["load", "20%", "--for", duration, "--socket", "/none"])
    assert result.exit_code == 2, result.exception
    assert "expected a duration such as 90s, 10m or 1h" in result.stderr
