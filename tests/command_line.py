"""`oarlock` as it is typed."""

from typer.testing import CliRunner, Result

from oarlock.cli import app


def run(*arguments: object, status: int = 0) -> Result:
    """Runs a command, which must end with this exit status."""
    done = CliRunner().invoke(app, [str(argument) for argument in arguments], prog_name="oarlock")
    assert done.exit_code == status, done.output
    return done
