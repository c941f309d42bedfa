"""Says that the package holds compiled code, so that the wheel is of this Python and this machine."""
from setuptools import Distribution, setup


class Compiled(Distribution):
    def has_ext_modules(self):
        return True


setup(distclass=Compiled)
