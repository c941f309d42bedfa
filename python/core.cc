#include "python/bindings.h"
#include "python/errors.h"

PYBIND11_MODULE(_core, module) {
  module.doc() = "C++ behind the package mvstudio.";
  module.attr("__version__") = MVSTUDIO_VERSION;
  mvstudio::python::TranslateErrors();
  mvstudio::python::BindRig(module);
  mvstudio::python::BindTriangulate(module);
  mvstudio::python::BindStages(module);
  mvstudio::python::BindImages(module);
  mvstudio::python::BindSamples(module);
  mvstudio::python::BindBodies(module);
}
