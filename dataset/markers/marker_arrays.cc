#include <cmath>

#include "core/csv.h"
#include "core/disk/npy_write.h"
#include "core/text/shortest_text.h"
#include "dataset/markers/marker_files.h"
#include "dataset/pose/markers.h"

namespace mvstudio::markers {
namespace {

Eigen::Vector3d InSpace(const Eigen::Vector3d& x_in_world, const FileSpace& space) {
  return dataset::AxesFromWorld(x_in_world, space.up) / dataset::MetresPerUnit(space.unit).value_or(1);
}

}  // namespace

std::string WideCsvText(const MarkerTake& take, const FileSpace& space) {
  std::string text = "frame,time_s";
  for (const std::string& name : take.names) {
    for (const char* axis : {"_x_", "_y_", "_z_"}) text += "," + CsvCell(name + axis + space.unit);
  }
  text += "\n";
  for (int f = 0; f < take.num_frames(); ++f) {
    text += std::to_string(int64_t{take.first_frame} + f) + ",";
    AppendShortestText(f / take.rate_hz, &text);
    for (int m = 0; m < take.num_markers(); ++m) {
      const size_t i = take.Index(f, m);
      const Eigen::Vector3d x = InSpace(take.x_in_world[i], space);
      for (int k = 0; k < 3; ++k) {
        text += ",";
        if (take.source[i] != Source::kMissing) AppendShortestText(x[k], &text);
      }
    }
    text += "\n";
  }
  return text;
}

std::string StoText(const MarkerTake& take, const FileSpace& space) {
  std::string text =
      "DataRate=" + ShortestText(take.rate_hz) + "\nDataType=Vec3\nversion=3\nUnits=" + space.unit + "\nendheader\ntime";
  for (const std::string& name : take.names) text += "\t" + name;
  text += "\n";
  for (int f = 0; f < take.num_frames(); ++f) {
    AppendShortestText((double{1} * take.first_frame + f) / take.rate_hz, &text);
    for (int m = 0; m < take.num_markers(); ++m) {
      const size_t i = take.Index(f, m);
      const Eigen::Vector3d x = InSpace(take.x_in_world[i], space);
      for (int k = 0; k < 3; ++k) {
        text += k == 0 ? "\t" : ",";
        if (take.source[i] == Source::kMissing)
          text += "NaN";
        else
          AppendShortestText(x[k], &text);
      }
    }
    text += "\n";
  }
  return text;
}

std::string NpzBytes(const MarkerTake& take, const FileSpace& space) {
  std::vector<double> joints;
  std::vector<int64_t> frames, filled;
  for (int f = 0; f < take.num_frames(); ++f) frames.push_back(int64_t{take.first_frame} + f);
  for (size_t i = 0; i < take.source.size(); ++i) {
    const Eigen::Vector3d x =
        take.source[i] == Source::kMissing ? Eigen::Vector3d::Constant(std::nan("")) : InSpace(take.x_in_world[i], space);
    for (int k = 0; k < 3; ++k) joints.push_back(x[k]);
    filled.push_back(take.source[i] == Source::kFilled);
  }
  const size_t num_frames = frames.size(), num_markers = take.names.size();
  return NpzOf({{"joints", NpyOfDoubles({num_frames, 1, num_markers, 3}, joints)},
                {"joint_names", NpyOfTexts(take.names)},
                {"frames", NpyOfInts({num_frames}, frames)},
                {"people", NpyOfInts({1}, {take.person})},
                {"rate_hz", NpyOfDoubles({1}, {take.rate_hz})},
                {"sigma_m", NpyOfDoubles({num_frames, 1, num_markers}, take.sigma_m)},
                {"filled", NpyOfInts({num_frames, 1, num_markers}, filled)},
                {"unit", NpyOfTexts({space.unit})}});
}

}  // namespace mvstudio::markers
