"""Which class answers for which attribute of a Board.

A row is `attribute: (module, class)`; the class is called with the board when the attribute is first used.
It raises ModuleMissing if the card has no such part, and registers what must be turned off with
Board.on_close.
"""

from __future__ import annotations

PARTS: dict[str, tuple[str, str]] = {
    "cards": ("hostmot2.cards", "Cards"),
    "engine": ("hostmot2.engine", "Engines"),
    "cycle": ("hostmot2.cycle", "Cycle"),
    "ioport": ("hostmot2.modules.ioport", "Ioport"),
    "gpio": ("hostmot2.modules.ioport", "Gpio"),
    "watchdog": ("hostmot2.modules.watchdog", "Watchdog"),
    "leds": ("hostmot2.modules.led", "Leds"),
    "sserial": ("hostmot2.sserial", "SserialPorts"),
    "encoders": ("hostmot2.modules.encoder_module", "Encoders"),
    "stepgens": ("hostmot2.modules.stepgen", "Stepgens"),
    "pwmgens": ("hostmot2.modules.pwmgen", "Pwmgens"),
    "dpll": ("hostmot2.modules.dpll", "Dpll"),
    "tp_pwms": ("hostmot2.modules.tp_pwm", "TpPwms"),
    "rcpwms": ("hostmot2.modules.rcpwm", "Rcpwms"),
    "ssrs": ("hostmot2.modules.outputs", "Ssrs"),
    "outms": ("hostmot2.modules.outputs", "Outms"),
    "inms": ("hostmot2.modules.field_input", "Inms"),
    "inmuxes": ("hostmot2.modules.field_input", "Inmuxes"),
    "oneshots": ("hostmot2.modules.oneshot", "Oneshots"),
    "periods": ("hostmot2.modules.period", "Periods"),
    "resolvers": ("hostmot2.modules.resolver", "Resolvers"),
    "ssis": ("hostmot2.modules.ssi", "Ssis"),
    "uarts": ("hostmot2.modules.uart", "Uarts"),
    "pktuarts": ("hostmot2.modules.pktuart", "Pktuarts"),
    "bspis": ("hostmot2.modules.bspi", "Bspis"),
    "bisses": ("hostmot2.modules.unsupported", "Bisses"),
    "fanucs": ("hostmot2.modules.unsupported", "Fanucs"),
    "xy2mods": ("hostmot2.modules.unsupported", "Xy2mods"),
}
