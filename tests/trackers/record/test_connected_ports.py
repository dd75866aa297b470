"""The list of ports: trackers named, and what to do where one has no port."""

from pathlib import Path

from shukotsu.trackers.record import port as connected_ports


def test_ports_are_listed_and_trackers_named() -> None:
    ports = [
        ("/dev/ttyS0", None, None, "ttyS0"),
        ("/dev/ttyUSB0", 0x0F44, 0xFF20, "Polhemus"),
        ("/dev/ttyUSB1", 0x0403, 0x6001, "FT232R USB UART"),
    ]
    assert connected_ports.port_lines(ports, [(0x0F44, 0xFF20)]) == [
        "/dev/ttyS0  ttyS0",
        "/dev/ttyUSB0  LIBERTY (high-speed USB) (USB 0f44:ff20)",
        "/dev/ttyUSB1  FT232R USB UART (USB 0403:6001)",
    ]


def test_a_tracker_without_a_port_is_told_with_what_to_do() -> None:
    told = "\n".join(connected_ports.port_lines([], [(0x1D6B, 0x0002), (0x0F44, 0xEF12)]))
    assert told.startswith("USB 0f44:ef12  PATRIOT: ready")
    assert "modprobe usbserial vendor=0x0f44 product=0xef12" in told
    assert "fxload" in "\n".join(connected_ports.port_lines([], [(0x0F44, 0xFF21)]))
    assert connected_ports.port_lines([], [(0x0F44, 0xCF01)]) == [
        "USB 0f44:cf01  G4: not read by this program"
    ]


def test_usb_is_read_from_the_system(tmp_path: Path) -> None:
    for name, vendor, product in (("1-1", "0f44", "ff20"), ("usb1", "1d6b", "0002")):
        (tmp_path / name).mkdir()
        (tmp_path / name / "idVendor").write_text(f"{vendor}\n")
        (tmp_path / name / "idProduct").write_text(f"{product}\n")
    (tmp_path / "half").mkdir()
    (tmp_path / "half" / "idVendor").write_text("0f44\n")
    assert connected_ports.usb_devices(tmp_path) == [(0x0F44, 0xFF20), (0x1D6B, 0x0002)]
    assert connected_ports.usb_devices(tmp_path / "none") == []
