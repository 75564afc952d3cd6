"""What the tests know of URScript, by its manuals."""

from tests.programs.controllers import DialectFacts, Language

# Universal Robots: the slider is set by RTDE (speed_slider_fraction), or by 'set speed' at port 30003
OVERRIDE = Language(
    motion=r"move[jc]\(.*v=(?:d2r\()?(?P<v>[\d.]+).*",
    knob=r".*speed_slider\w*\((?P<value>.*)\)",
    comment=r"#[^\r\n]*",
    forbidden=r"speed_slider|speed_fraction|set speed|socket_|rtde_",
)
REFUSED = [
    "set_standard_digital_out(1, True)",
    "other()",
    "movel(p[0, 0, 0, 0, 0, 0])",
    "movej([1, 2], v=1)",
    "if True:",
    "end",
    "def f():",
    "run other()",
    "stopj(2)",
    "set_payload(5)",
    "start_at = 3",
]
DIALECTS = {
    "urscript": DialectFacts(
        given_back=r"set_standard_digital_out|start_at|title|error|blocking",
        stop=r"^ *popup\(.*blocking=True\)$",
        wait=r"^ *edbb_wait_ready\(\)$",
        shown='popup("pose 3 of 4: read the gauge, then press Continue", title="edbb", blocking=True)',
    ),
}
