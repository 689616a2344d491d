"""Commands of click that report all errors of a command line at once."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping
from typing import Any

import click

from ..basics.descriptions import docstring
from ..basics.errors import BadInput


class OptionValues(dict[str, Any]):
    """Values of the parameters of a command by name; None stands for one that was not given or could not be read.

    Attributes
    ----------
    given : set of str
        Names of the parameters on the command line, those that could not be read included.
    """

    def __init__(self, values: Mapping[str, Any], given: set[str]):
        super().__init__(values)
        self.given = given


Check = Callable[[OptionValues], Iterable[str]]
"""Errors of values, one line each."""


class WrongOptions(click.UsageError):
    """Several errors of a command line.

    Attributes
    ----------
    lines : list of str
        One line for each.
    """

    def __init__(self, lines: list[str], context: click.Context):
        super().__init__("; ".join(lines), context)
        self.lines = lines


class Command(click.Command):
    """A command that reports unknown options, missing values, wrong values and missing arguments together.

    Click itself stops at the first error; after that, this class reads the rest of the command line.

    Parameters
    ----------
    check : callable, optional
        Checks of values together, or of values whose check needs imports that `--help` does without.
    """

    def __init__(self, *given: Any, check: Check = lambda values: (), **settings: Any):
        super().__init__(*given, **settings)
        self._check = check

    def parse_args(self, ctx: click.Context, args: list[str]) -> list[str]:
        """Read the command line into `ctx.params`.

        Raises
        ------
        WrongOptions
            All errors, if one is of the form of the command line.
        BadInput
            All errors, if only values are wrong.
        """
        words = list(args)
        if ctx.resilient_parsing:  # completion in a shell
            return super().parse_args(ctx, args)
        try:
            rest = super().parse_args(ctx, args)
        except (click.UsageError, BadInput) as error:
            usage, values = self._errors(ctx, words)
            if not usage and values:
                raise BadInput(values) from None
            raise WrongOptions([*usage, *values] or [_text(error)], ctx) from None
        if swallowed := self._swallowed(ctx.params):
            raise WrongOptions(list(swallowed.values()), ctx)
        given = {name for name, value in ctx.params.items() if value is not None}
        if problems := list(self._check(OptionValues(ctx.params, given))):
            raise BadInput(problems)
        return rest

    def _swallowed(self, values: Mapping[str, Any]) -> dict[str, str]:
        """Errors, by parameter, of options that took the next option as their value, as in `--out --overwrite`."""
        given = [param for param in self.params if isinstance(param, click.Option)]
        names = {name for param in given for name in (*param.opts, *param.secondary_opts)}
        return {
            str(param.name): f"Option {param.opts[0]!r} requires an argument"
            for param in given
            if isinstance(values.get(str(param.name)), str) and values[str(param.name)] in names
        }

    def _errors(self, ctx: click.Context, words: list[str]) -> tuple[list[str], list[str]]:
        """All errors of a command line with at least one: of its form, and of values."""
        probe = click.Context(self, ctx.parent, ctx.info_name)
        usage, reported, (found, rest) = self._errors_of_form(probe, words)
        swallowed = self._swallowed(found)
        usage += swallowed.values()
        values: list[str] = []
        for param in sorted(self.get_params(probe), key=lambda one: not one.is_eager):  # --help comes first, and exits
            if str(param.name) in swallowed or reported & {*param.opts, *param.secondary_opts}:
                continue
            try:
                param.handle_parse_result(probe, found, rest)
            except BadInput as error:
                values += error.problems
            except click.UsageError as error:
                usage.append(_text(error))
        given = {str(param.name): probe.params.get(str(param.name)) for param in self.params if param.name in found}
        read = {name: value for name, value in given.items() if isinstance(value, (str, int, float, list, tuple))}
        known = {str(param.name): None for param in self.params} | read
        return usage, [*values, *self._check(OptionValues(known, set(given)))]

    def _errors_of_form(
        self, ctx: click.Context, words: list[str]
    ) -> tuple[list[str], set[str], tuple[dict[str, Any], list[str]]]:
        """Errors of the form of a command line: their texts, the names of the options, and what could be read.

        Each word with an error is left out, and the rest read again.
        """
        problems: list[str] = []
        names: set[str] = set()
        after: list[str] = []  # words after unknown options, which may be their values
        while True:
            try:
                found, rest, _ = self.make_parser(ctx).parse_args(list(words))
            except (click.NoSuchOption, click.BadOptionUsage) as error:
                problems.append(_text(error))
                names.add(error.option_name)
                k = next((k for k, word in enumerate(words) if _is_use(word, error.option_name)), None)
                if k is None:
                    return problems, names, ({}, [])
                if isinstance(error, click.NoSuchOption):
                    after += [word for word in words[k + 1 : k + 2] if not word.startswith("-")]
                # an option with too few values is the last one
                del words[k : k + 1 if isinstance(error, click.NoSuchOption) or "=" in words[k] else None]
                continue
            if not rest or ctx.allow_extra_args or isinstance(self, click.Group):
                return problems, names, (found, rest)
            if after:
                words.remove(after.pop())
                continue
            problems.append(f"Got unexpected extra argument{'s' * (len(rest) > 1)} ({' '.join(rest)})")
            return problems, names, (found, rest)


class Group(Command, click.Group):
    """A group of commands whose own options are checked as those of `Command`."""


def _is_use(word: str, option: str) -> bool:
    """Whether a word of the command line uses an option, also as `--option=value` or among short ones, `-abc`."""
    short = len(option) == 2 and not word.startswith("--") and word.startswith("-") and option[1] in word
    return word.partition("=")[0] == option or short


def _text(error: Exception) -> str:
    """The message of an error as one line without a full stop."""
    text = error.format_message() if isinstance(error, click.UsageError) else str(error)
    return " ".join(text.split()).rstrip(".")


def command(name: str, **settings: Any) -> Callable[[Callable[..., Any]], Command]:
    """Decorator that makes a `Command` of a function; the settings are those of `click.command`, and `check`."""
    return lambda function: click.command(name, cls=Command, help=docstring(function), **settings)(function)
