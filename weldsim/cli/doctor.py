"""`weldsim doctor`."""

from dataclasses import asdict, dataclass

from weldsim.cli.show import print_json, progress


@dataclass(frozen=True, kw_only=True)
class Doctor:
    """Try every library, the rendering back end and write access, and say what to install where something fails."""

    json: bool = False
    """Print one JSON object and nothing else on stdout."""

    def __call__(self) -> int:
        """1 where something does not work, else 0."""
        from weldsim.doctor import diagnose

        with progress() as tell:
            tell("checking", None)
            checks = diagnose()
        ok = all(check.ok for check in checks)
        if self.json:
            print_json({"ok": ok, "checks": [asdict(check) for check in checks]})
            return 0 if ok else 1
        width = max(len(check.name) for check in checks)
        for check in checks:
            print(f"{'ok  ' if check.ok else 'FAIL'}  {check.name.ljust(width)}  {check.detail}")
            if check.remedy:
                print(f"{' ' * (width + 8)}-> {check.remedy}")
        print("everything works" if ok else "some things do not work: do what the arrows say")
        return 0 if ok else 1
