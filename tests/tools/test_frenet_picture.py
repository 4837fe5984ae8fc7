from tools import frenet_picture


def test_the_picture_in_the_documentation_can_be_drawn():
    assert frenet_picture.draw_twist().startswith(b"\x89PNG\r\n\x1a\n")
