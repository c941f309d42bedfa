#pragma once

#include <optional>
#include <string>
#include <vector>

namespace mvstudio::dataset {

/// One camera of a sync file. Frame `f` of the reference and frame `offset_frames + f * nominal_rate / (1 + rate_ppm / 1e6)`
/// of this camera show the same time step.
struct SyncedCamera {
  std::string name;
  std::string status = "Ok";            ///< "Ok", or why there is no offset
  std::optional<double> offset_frames;  ///< only with "Ok"
  double sigma_frames = 0;              ///< its standard deviation; 0 for the reference
  double nominal_rate = 1;              ///< its frames for one of the reference, by the cameras' nominal rates
  double rate_ppm = 0;                  ///< excess of its frame period over the nominal one; 0 where it is not known
};

/// `sync.json`: time offsets of the cameras of a take.
struct SyncFile {
  std::string reference;
  std::optional<double> fps;  ///< of the reference, where known
  std::vector<SyncedCamera> cameras;
};

/// Throws ContractViolation for numbers that are not finite. Files in which cameras have other rates are "mvstudio.sync/2", so
/// that a program that does not know rates refuses them.
void WriteSync(const SyncFile& sync, const std::string& path);

/// Throws IoError, FormatError (path, place): wrong schema, a camera twice, "Ok" without an offset, offsets beyond 1e6 frames.
SyncFile ReadSync(const std::string& path);

/// Offsets in the order of `names`; NaN for cameras that are not in the file or have no offset.
std::vector<double> OffsetsOf(const SyncFile& sync, const std::vector<std::string>& names);
/// Frames of each camera for one of the reference; 1 for cameras that are not in the file.
std::vector<double> RatesOf(const SyncFile& sync, const std::vector<std::string>& names);

}  // namespace mvstudio::dataset
