"""Build of the compiled core; everything else is in pyproject.toml."""

import os
from concurrent.futures import ThreadPoolExecutor

from setuptools import setup
from setuptools.command.build_ext import build_ext


class SideBySide(build_ext):
    """Compile the files of an extension at the same time: setuptools takes one after the other."""

    def build_extension(self, ext):
        if self.compiler.compiler_type == "msvc":
            raise SystemExit(
                "pkmcal: Microsoft's C compiler does not know vectors; install a wheel, which"
                " 'python -m wheels.build windows-x86_64' builds with the PyPI package ziglang"
            )
        print(f"compiling {len(ext.sources)} C files: a minute or two", flush=True)
        compile_one, link = self.compiler._compile, self.compiler.link_shared_object
        with ThreadPoolExecutor(os.cpu_count()) as pool:
            objects = []

            def compile_later(*arguments, **options):
                objects.append(pool.submit(compile_one, *arguments, **options))

            def wait_and_link(*arguments, **options):
                for each in objects:
                    each.result()  # what the compiler raised
                link(*arguments, **options)

            self.compiler._compile, self.compiler.link_shared_object = compile_later, wait_and_link
            try:
                super().build_extension(ext)
            finally:
                self.compiler._compile, self.compiler.link_shared_object = compile_one, link


setup(
    cffi_modules="csrc/build.py:ffibuilder",
    cmdclass={"build_ext": SideBySide},
    options={"bdist_wheel": {"py_limited_api": "cp310"}},
)
