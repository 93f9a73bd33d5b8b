"""Motion logs: tables, the checked log, low-pass filtering and differentiation, held-out blocks, motion regimes."""
