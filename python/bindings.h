// Private: pybind11's types.
#pragma once

#include <pybind11/pybind11.h>

/// One function a file of this folder: what it adds to the module.
namespace mvstudio::python {

void BindRig(pybind11::module_& module);
void BindTriangulate(pybind11::module_& module);
void BindStages(pybind11::module_& module);
void BindImages(pybind11::module_& module);
void BindSamples(pybind11::module_& module);
void BindBodies(pybind11::module_& module);

}  // namespace mvstudio::python
