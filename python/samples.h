// Private: pybind11's types.
#pragma once

#include <pybind11/pybind11.h>

#include <memory>
#include <string>
#include <vector>

#include "core/image.h"
#include "dataset/pack/pack.h"

namespace mvstudio::python {

/// Images of people with their cameras, masks and joints: those of a pack, or those that a dataset's files give. May be called
/// by several threads.
class SampleSource {
 public:
  virtual ~SampleSource() = default;
  virtual const geometry::Rig& rig() const = 0;
  virtual const std::vector<dataset::PackSample>& samples() const = 0;
  virtual Image ReadImage(size_t i) const = 0;
  virtual Image ReadMask(size_t i) const = 0;  ///< empty: it has none
  /// Encoded as it is stored. Throws UsageError where nothing is.
  virtual std::string ReadImageBytes(size_t i) const = 0;
  virtual pybind11::dict About() const = 0;
};

std::shared_ptr<SampleSource> OpenPackSource(const std::string& path, bool check);

/// What mvstudio/_samples.py says of Dataset.
struct DatasetSourceOptions {
  int crop_px = 128;  ///< 0: whole images
  double fill = 0.97;
  double half_extent_m = 0;  ///< 0: by the person's poses
  int person = -1;           ///< -1: whom most frames show
  bool masks = true;
  std::string split;  ///< file; empty: none
};
std::shared_ptr<SampleSource> OpenDatasetSource(const std::string& folder, const DatasetSourceOptions& options);

}  // namespace mvstudio::python
