// Private: pybind11's types.
#pragma once

#include <pybind11/pybind11.h>

#include <string>
#include <vector>

#include "core/notice.h"
#include "geometry/rig/rig.h"

namespace mvstudio::python {

/// A rig that no longer changes, with what its loops need.
struct HeldRig {
  explicit HeldRig(geometry::Rig rig_, std::vector<Notice> notes_ = {});

  geometry::Rig rig;
  std::vector<Notice> notes;
  std::vector<geometry::Projector> projectors;  ///< one a camera

  /// A camera by its name or its index; negative ones count from the end. Throws UsageError.
  size_t Camera(const pybind11::object& camera) const;
};

}  // namespace mvstudio::python
