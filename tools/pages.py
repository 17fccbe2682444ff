# Copyright 2026 The nfo_sinus_driver authors
# SPDX-License-Identifier: Apache-2.0

"""All pages of docs/ that are made, as a whole or their tables; ``make pages`` writes them."""

from __future__ import annotations

from pathlib import Path

import control_page
import manuals_page
import parameters_page
import settings_page
import troubleshooting_page

DOCS = Path(__file__).resolve().parents[1] / 'docs'


def pages() -> dict[Path, str]:
    """Return what each of them has to be."""
    return {
        DOCS / 'control.md': control_page.page(),
        DOCS / 'interface.md': settings_page.page(),
        DOCS / 'manuals.md': manuals_page.page(),
        DOCS / 'parameters.md': parameters_page.page(),
        DOCS / 'troubleshooting.md': troubleshooting_page.page(),
    }


if __name__ == '__main__':
    for path, text in pages().items():
        path.write_text(text, encoding='utf-8')
