"""The command line as a test runs it."""

import pytest

from gonio.cli import main


def run(capsys, *arguments):
    """(exit code, stdout, stderr) of a verb."""
    with pytest.raises(SystemExit) as left:
        main([str(argument) for argument in arguments])
    said = capsys.readouterr()
    return left.value.code, said.out, said.err
