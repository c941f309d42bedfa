#include <cmath>

#include "core/text/shortest_text.h"
#include "dataset/markers/joint_angles.h"

namespace mvstudio::markers {
namespace {

/// Angles that have a value in some frame, or joints for one.
std::vector<size_t> Told(const AngleTake& take, bool with_value) {
  std::vector<size_t> told;
  for (size_t a = 0; a < AngleDefinitions().size(); ++a) {
    bool any = false;
    for (int f = 0; f < take.num_frames() && !any; ++f) {
      const AngleStatus status = take.At(f, a).status;
      any = with_value ? status == AngleStatus::kOk : status != AngleStatus::kMissingJoint;
    }
    if (any) told.push_back(a);
  }
  return told;
}

/// A millionth of a degree is beyond what anybody measures.
void AppendDegrees(double deg, std::string* text) { AppendShortestText(std::round(1e6 * deg) / 1e6 + 0.0, text); }

}  // namespace

std::string AnglesCsvText(const AngleTake& take) {
  std::string text = "frame,time_s,angle,value_deg,sigma_deg,status\n";
  const std::vector<size_t> told = Told(take, false);
  for (int f = 0; f < take.num_frames(); ++f) {
    for (const size_t a : told) {
      const Angle& angle = take.At(f, a);
      text += std::to_string(int64_t{take.first_frame} + f) + ",";
      AppendShortestText(f / take.rate_hz, &text);
      text += "," + AngleDefinitions()[a].name + ",";
      if (std::isfinite(angle.deg)) AppendDegrees(angle.deg, &text);
      text += ",";
      if (std::isfinite(angle.sigma_deg)) AppendDegrees(angle.sigma_deg, &text);
      text += "," + std::string(ToString(angle.status)) + "\n";
    }
  }
  return text;
}

std::string MotText(const AngleTake& take, const std::string& name) {
  std::vector<size_t> columns;
  for (const size_t a : Told(take, true)) {
    if (!AngleDefinitions()[a].opensim.empty()) columns.push_back(a);
  }
  std::string text = name + "\nversion=1\nnRows=" + std::to_string(take.num_frames()) +
                     "\nnColumns=" + std::to_string(columns.size() + 1) + "\ninDegrees=yes\nendheader\ntime";
  for (const size_t a : columns) text += "\t" + AngleDefinitions()[a].opensim;
  text += "\n";
  for (int f = 0; f < take.num_frames(); ++f) {
    AppendShortestText(f / take.rate_hz, &text);
    for (const size_t a : columns) {
      text += "\t";
      if (std::isfinite(take.At(f, a).deg))
        AppendDegrees(take.At(f, a).deg, &text);
      else
        text += "NaN";
    }
    text += "\n";
  }
  return text;
}

}  // namespace mvstudio::markers
