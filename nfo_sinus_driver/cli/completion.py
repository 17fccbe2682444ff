# Copyright 2026 The nfo_sinus_driver authors
# SPDX-License-Identifier: Apache-2.0

"""The verb ``completion``: a script that makes a shell complete what is typed."""

from __future__ import annotations

import argparse

from nfo_sinus_driver.cli import options as typed
from nfo_sinus_driver.cli.console import put

#: A verb may follow options; a value follows its option; file names are completed by default.
_SCRIPT = """\
_nfo_sinus() {{
  local current=${{COMP_WORDS[COMP_CWORD]}} before=${{COMP_WORDS[COMP_CWORD-1]}} verb= word
  for word in "${{COMP_WORDS[@]:1:COMP_CWORD-1}}"; do
    case $word in
      {verbs}) verb=$word; break ;;
    esac
  done
  local words=
  case $before in
{values}
    *) case $verb in
{words}
    esac ;;
  esac
  COMPREPLY=($(compgen -W "$words" -- "$current"))
}}
complete -o default -F _nfo_sinus nfo-sinus
"""


def completion(options: argparse.Namespace) -> int:
    """Print the script for a shell."""
    put(script(options.shell))
    return 0


def script(shell: str) -> str:
    """Return the script for a shell."""
    words = typed.words()
    every = sorted({word for known in words.values() for word in known if word.startswith('--')})
    values = {option: typed.values_of(option) for option in every}
    text = _SCRIPT.format(
        verbs='|'.join(verb for verb in words if verb),
        values='\n'.join(
            f"    {option}) words='{' '.join(known)}' ;;"
            for option, known in values.items()
            if known
        ),
        words='\n'.join(
            f"      '{verb}') words='{' '.join(known)}' ;;" for verb, known in words.items()
        ),
    )
    # zsh takes the same one
    return f'autoload -U +X bashcompinit && bashcompinit\n{text}' if shell == 'zsh' else text
