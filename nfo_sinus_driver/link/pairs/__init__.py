# Copyright 2026 The nfo_sinus_driver authors
# SPDX-License-Identifier: Apache-2.0

"""
Protocols whose answers differ from requests: Classic, NFO's own, and that of the MOVITRAC 31.

An answer can be told from a request, but a refusal and a confirmation name nothing: what is
believed rests on the kind of an answer (:mod:`.pair_link`).
"""
