# Copyright 2026 The nfo_sinus_driver authors
# SPDX-License-Identifier: Apache-2.0

"""Stands in for ros2doctor 0.32, of which there is no wheel: what a report and a check need."""


class DoctorCheck:
    pass


class DoctorReport:
    pass


class Report:
    def __init__(self, name: str) -> None:
        self.name = name
        self.items: list[tuple[str, str]] = []

    def add_to_report(self, item_name: str, item_info: str) -> None:
        self.items.append((item_name, item_info))


class Result:
    def __init__(self) -> None:
        self.error = self.warning = 0

    def add_error(self) -> None:
        self.error += 1

    def add_warning(self) -> None:
        self.warning += 1
