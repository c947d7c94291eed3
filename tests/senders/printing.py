"""Functions that all drivers of printing hosts use. `ask(line, text)` sends a line and returns a line with the text in
it."""

from steps import ensure


def settings(ask):
    """Sets the steps and limits of a printer, and stores them: a later connection resets the board. Returns the answer
    to M503."""
    for line in ["M92 X80 Y80 Z400 E93", "M203 X150 Y150 Z10 E50", "M201 X1000 Y1000 Z100 E5000", "M500"]:
        ask(line, "ok")
    text = ask("M503", "M92")
    ensure("X80.000 Y80.000 Z400.000 E93.000" in text, text)
    return text


def place(ask):
    """Returns the position of each axis, by its letter."""
    words = ask("M114", "Count").split()
    return {word[0]: float(word[2:]) for word in words[:4]}


def settle(send, ask, name="all carried out"):
    """Waits until all lines have been executed. M118 waits behind M400, whose own `ok` looks like that of any line."""
    send("M400")
    ask(f"M118 {name}", name)


def there_and_back(moves, way=0.5):
    """Returns the lines of a print that ends where it begins."""
    return ["G91"] + [f"G1 X{way} F1200", f"G1 X-{way}"] * moves + ["G90"]
