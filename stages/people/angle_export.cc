#include <algorithm>
#include <cmath>
#include <filesystem>
#include <map>

#include "core/disk/files.h"
#include "core/format.h"
#include "core/statistics.h"
#include "dataset/markers/gait_events.h"
#include "dataset/markers/joint_angles.h"
#include "stages/people/marker_export.h"

namespace mvstudio::stages {
namespace {

using nlohmann::ordered_json;

/// What no centres of joints tell.
constexpr char kNotDetermined[] =
    "tilt of the pelvis against the trunk, adduction and rotation of the knee, inversion of the foot, turn of the forearm";

bool HasUp(const dataset::Pose3d& pose) { return pose.world.find("axes of camera ") == std::string::npos; }

ordered_json AngleJson(const markers::AngleTake& take, size_t angle) {
  std::vector<double> values, sigmas;
  std::map<std::string, int> missing;
  for (int f = 0; f < take.num_frames(); ++f) {
    const markers::Angle& at = take.At(f, angle);
    if (at.status != markers::AngleStatus::kOk) {
      ++missing[std::string(ToString(at.status))];
      continue;
    }
    values.push_back(at.deg);
    if (std::isfinite(at.sigma_deg)) sigmas.push_back(at.sigma_deg);
  }
  ordered_json json = {{"frames", values.size()}, {"missing", missing}};
  if (values.empty()) return json;
  json["min_deg"] = *std::min_element(values.begin(), values.end());
  json["max_deg"] = *std::max_element(values.begin(), values.end());
  json["median_sigma_deg"] = FiniteOrNull(UpperMedian(std::move(sigmas), std::nan("")));
  return json;
}

}  // namespace

AngleFiles AnglesOfPerson(const markers::MarkerTake& take, const dataset::Pose3d& pose, const std::string& name) {
  std::map<std::pair<int, std::string>, const dataset::JointRow*> rows;
  for (const dataset::JointRow& row : pose.rows) {
    if (row.person == take.person && row.status == Status::kOk) rows[{row.frame, row.joint}] = &row;
  }
  const auto covariance = [&](int frame, const std::string& joint) -> std::optional<Eigen::Matrix3d> {
    const auto found = rows.find({frame, joint});
    if (found == rows.end()) return std::nullopt;
    const dataset::JointRow& row = *found->second;
    if (row.covariance) return row.covariance;
    if (!(row.sigma_m > 0)) return std::nullopt;
    return Eigen::Matrix3d(row.sigma_m * row.sigma_m * Eigen::Matrix3d::Identity());
  };
  const markers::AngleTake angles = AnglesOf(take, HasUp(pose), covariance);
  AngleFiles files;
  files.csv = AnglesCsvText(angles), files.mot = MotText(angles, name);
  int told = 0, partly = 0;
  std::string gone;
  for (size_t a = 0; a < markers::AngleDefinitions().size(); ++a) {
    const ordered_json json = AngleJson(angles, a);
    const int frames = json["frames"].get<int>();
    const std::string& angle = markers::AngleDefinitions()[a].name;
    files.metrics[angle] = json;
    told += frames > 0, partly += frames > 0 && frames < angles.num_frames();
    if (frames == 0) gone += (gone.empty() ? "" : ", ") + angle;
  }
  files.text = Format("person %d: %d of %zu joint angles", take.person, told, markers::AngleDefinitions().size());
  if (partly > 0) files.text += Format(", %d of them not in every frame (`status` says why)", partly);
  if (!gone.empty()) files.text += "; in no frame: " + gone;
  files.text += std::string("; no joint centres tell: ") + kNotDetermined + "\n";
  return files;
}

void WriteGaitEvents(const std::vector<MarkerWork>& work, const dataset::Pose3d& pose, const std::string& folder,
                     const std::string& final_folder, CommandResult* result) {
  ordered_json persons = ordered_json::array();
  for (const MarkerWork& person : work) {
    const markers::GaitReport report = FindGaitEvents(person.after, HasUp(pose));
    const int id = person.after.person;
    ordered_json events = ordered_json::array();
    int strikes = 0, sure = 0;
    for (const markers::GaitEvent& event : report.events) {
      strikes += event.kind == markers::GaitEventKind::kHeelStrike, sure += event.confidence == markers::GaitConfidence::kHigh;
      events.push_back({{"frame", event.frame},
                        {"side", event.left ? "left" : "right"},
                        {"event", std::string(ToString(event.kind))},
                        {"confidence", std::string(ToString(event.confidence))}});
    }
    persons.push_back({{"person", id}, {"events", events}});
    if (!report.note.empty()) persons.back()["note"] = report.note;
    if (report.events.empty()) {
      persons.back()["why_none"] = report.why_none;
      result->text += Format("person %d: no gait events: ", id) + report.why_none + "\n";
      continue;
    }
    persons.back()["speed_m_s"] = report.speed_m_s, persons.back()["cadence_per_min"] = report.cadence_per_min;
    result->text +=
        Format(
            "person %d: %d heel strikes, %zu toe offs proposed, %d of them with high confidence; %.2f m/s, %.0f steps a minute",
            id, strikes, report.events.size() - static_cast<size_t>(strikes), sure, report.speed_m_s, report.cadence_per_min) +
        (report.note.empty() ? "" : "; " + report.note) + "\n";
    const std::string name = "person" + std::to_string(id) + ".events.csv";
    WriteFileAtomic((std::filesystem::path(folder) / name).string(), GaitCsvText(report, person.after));
    result->outputs.push_back({(std::filesystem::path(final_folder) / name).string(), "events"});
  }
  result->metrics["gait"] = {{"persons", persons}};
}

}  // namespace mvstudio::stages
