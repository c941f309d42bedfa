#include "stages/people/marker_export.h"

#include <algorithm>
#include <cmath>
#include <filesystem>
#include <sstream>

#include "core/disk/files.h"
#include "core/error.h"
#include "core/format.h"
#include "core/join.h"
#include "dataset/footage/frame_rate.h"
#include "dataset/markers/bvh.h"
#include "dataset/markers/marker_files.h"
#include "dataset/markers/opensim.h"
#include "stages/words.h"

namespace mvstudio::stages {
namespace {

using nlohmann::ordered_json;

const std::vector<std::string>& KnownFormats() {
  static const std::vector<std::string> formats = {"trc", "c3d", "csv", "wide", "npz", "sto", "bvh", "angles"};
  return formats;
}

std::vector<std::string> FormatsOf(const MarkerOptions& options) {
  std::vector<std::string> formats;
  std::istringstream stream(options.to);
  for (std::string word; std::getline(stream, word, ',');) formats.push_back(word);
  return formats;
}

ordered_json MotionJson(const markers::MarkerMotion& before, const markers::MarkerMotion& after) {
  return {{"measured", after.measured},
          {"filled", after.filled},
          {"missing", after.missing},
          {"missing_at_start", after.missing_at_start},
          {"missing_at_end", after.missing_at_end},
          {"acceleration_m_s2", FiniteOrNull(before.acceleration_m_s2)},
          {"filtered_acceleration_m_s2", FiniteOrNull(after.acceleration_m_s2)}};
}

ordered_json WorkJson(const MarkerWork& work) {
  const auto before = MeasureMotion(work.before), after = MeasureMotion(work.after);
  const markers::Displacement moved = MeasureDisplacement(work.before, work.after);
  ordered_json joints = ordered_json::object();
  int at_ends = 0;
  for (size_t m = 0; m < before.size(); ++m) {
    joints[before[m].name] = MotionJson(before[m], after[m]);
    at_ends += after[m].missing_at_start + after[m].missing_at_end;
  }
  ordered_json moves = ordered_json::array();
  for (const markers::Displacement::Move& move : moved.largest) {
    moves.push_back({{"joint", work.after.names[static_cast<size_t>(move.marker)]},
                     {"frame", work.after.first_frame + move.frame_idx},
                     {"moved_mm", 1000 * move.distance_m},
                     {"sigmas", FiniteOrNull(move.sigmas)}});
  }
  return {{"person", work.after.person},
          {"first_frame", work.after.first_frame},
          {"frames", work.after.num_frames()},
          {"gaps_filled", work.filled.num_gaps},
          {"positions_filled", work.filled.num_positions},
          {"positions_in_longer_gaps", work.filled.num_left},
          {"positions_at_ends", at_ends},
          {"acceleration_m_s2", FiniteOrNull(MeanAcceleration(before))},
          {"filtered_acceleration_m_s2", FiniteOrNull(MeanAcceleration(after))},
          {"moved_rms_mm", 1000 * moved.rms_m},
          {"moved_max_mm", 1000 * moved.max_m},
          {"moved_rms_sigmas", FiniteOrNull(moved.rms_sigmas)},
          {"largest_moves", moves},
          {"joints", joints}};
}

/// The farthest move, with its joint and frame, and what no gap is.
std::string EndOfLine(const ordered_json& person, bool fills) {
  std::string text;
  if (!person["largest_moves"].empty()) {
    const ordered_json& move = person["largest_moves"][0];
    text += Format(", %s at most (%s, frame %d)", LengthText(move["moved_mm"].get<double>() / 1e3).c_str(),
                   move["joint"].get<std::string>().c_str(), move["frame"].get<int>());
  }
  const int at_ends = person["positions_at_ends"].get<int>(), longer = person["positions_in_longer_gaps"].get<int>();
  if (fills && longer > 0) text += Format("; %d positions in longer gaps stay missing", longer);
  if (fills && at_ends > 0)
    text += Format("; %d positions before a joint's first or after its last are no gaps and stay missing", at_ends);
  return text;
}

std::string Line(const ordered_json& person, bool fills) {
  const auto number = [&person](const char* key) { return person[key].is_number() ? person[key].get<double>() : std::nan(""); };
  return Format(
             "person %d: %d frames, %d joints, %d positions filled in %d gaps; accelerations %.1f -> %.1f m/s2, moved by %s "
             "rms",
             person["person"].get<int>(), person["frames"].get<int>(), static_cast<int>(person["joints"].size()),
             person["positions_filled"].get<int>(), person["gaps_filled"].get<int>(), number("acceleration_m_s2"),
             number("filtered_acceleration_m_s2"), LengthText(number("moved_rms_mm") / 1e3).c_str()) +
         EndOfLine(person, fills);
}

/// Writes into a folder that gets its final name later.
class Writer {
 public:
  Writer(std::string folder, std::string final_folder, CommandResult* result)
      : folder_(std::move(folder)), final_folder_(std::move(final_folder)), result_(result) {}

  void Write(const std::string& name, const std::string& content, const std::string& role = "") {
    WriteFileAtomic((std::filesystem::path(folder_) / name).string(), content);
    result_->outputs.push_back({(std::filesystem::path(final_folder_) / name).string(), role});
  }

 private:
  std::string folder_, final_folder_;
  CommandResult* result_;
};

void WriteOpenSim(const markers::MarkerTake& take, const std::string& stem, Writer* writer) {
  writer->Write(stem + ".markers.xml", markers::OpenSimMarkerSet(take.names));
  writer->Write(stem + ".scale.xml", OpenSimScaling(take, stem));
  writer->Write(stem + ".ik.xml", OpenSimInverseKinematics(take, stem));
}

void SayWhatOpenSimLacks(const markers::MarkerTake& take, CommandResult* result) {
  const std::vector<std::string> known = markers::OpenSimMarkers(take.names);
  std::vector<std::string> lacking;
  for (const std::string& name : take.names) {
    if (std::find(known.begin(), known.end(), name) == known.end()) lacking.push_back(name);
  }
  if (lacking.empty()) return;
  result->warnings.push_back(
      {"MRK-OPENSIM",
       Format("person %d: %zu of %zu joints have no place on OpenSim's model: %s; its files leave them out", take.person,
              lacking.size(), take.names.size(), Join(lacking, ", ").c_str()),
       "the .trc holds them all; add them to the marker set if the model has a place for them"});
}

void WritePerson(const MarkerWork& work, const MarkerOptions& options, Writer* writer) {
  const std::string stem = "person" + std::to_string(work.after.person);
  for (const std::string& format : FormatsOf(options)) {
    const std::string file = stem + "." + format;
    if (format == "trc") writer->Write(file, TrcText(work.after, file, options.trc_unit), "markers");
    if (format == "c3d") writer->Write(file, C3dBytes(work.after), "markers");
    if (format == "csv") writer->Write(file, CsvText(work.after), "markers");
    if (format == "wide") writer->Write(stem + ".wide.csv", WideCsvText(work.after), "markers");
    if (format == "npz") writer->Write(file, NpzBytes(work.after), "markers");
    if (format == "sto") writer->Write(file, StoText(work.after), "markers");
  }
  if (options.opensim) WriteOpenSim(work.after, stem, writer);
}

bool Wants(const MarkerOptions& options, const char* format) {
  const std::vector<std::string> formats = FormatsOf(options);
  return std::find(formats.begin(), formats.end(), format) != formats.end();
}

void WriteAngles(const MarkerWork& work, const dataset::Pose3d& pose, Writer* writer, ordered_json* person,
                 CommandResult* result) {
  const std::string stem = "person" + std::to_string(work.after.person);
  AngleFiles files = AnglesOfPerson(work.after, pose, stem);
  writer->Write(stem + ".angles.csv", files.csv, "angles");
  writer->Write(stem + ".angles.mot", files.mot, "angles");
  (*person)["angles"] = std::move(files.metrics);
  result->text += files.text;
}

/// What a fit with bones of one length leaves, as metrics and as a line.
void WriteBvhFile(const MarkerWork& work, const geometry::Skeleton& skeleton, Writer* writer, ordered_json* person,
                  CommandResult* result) {
  const markers::MarkerBody hung = markers::HungFromPelvis(work.after, skeleton);
  const markers::BvhMotion motion = FitBvh(hung.take, hung.skeleton);
  writer->Write("person" + std::to_string(work.after.person) + ".bvh", BvhText(motion, hung.skeleton, work.after.rate_hz),
                "markers");
  (*person)["bvh"] = {{"joints", hung.skeleton.joints.size()},
                      {"rms_mm", 1000 * motion.rms_m},
                      {"max_mm", 1000 * motion.max_m},
                      {"held_frames", motion.num_held}};
  result->text += Format("person %d: bones of one length leave %s rms, %s at worst in the .bvh", work.after.person,
                         LengthText(motion.rms_m).c_str(), LengthText(motion.max_m).c_str());
  result->text += motion.num_held > 0 ? Format("; held in %d frames without a root\n", motion.num_held) : std::string("\n");
}

/// False, and said, where there are no bones.
bool HasHierarchy(const geometry::Skeleton& skeleton, CommandResult* result) {
  if (!skeleton.bones.empty()) return true;
  result->exit = kExitPartial;
  result->warnings.push_back({"MRK-BVH", "the joints have no bones, of which a hierarchy could be made: no .bvh was written",
                              "name the bones in a file, option 'skeleton' FILE.toml (docs/formats.md)"});
  return false;
}

}  // namespace

void CheckMarkerOptions(const MarkerOptions& options) {
  const std::vector<std::string> formats = FormatsOf(options);
  const auto has = [](const std::vector<std::string>& list, const std::string& word) {
    return std::find(list.begin(), list.end(), word) != list.end();
  };
  for (const std::string& format : formats) {
    if (!has(KnownFormats(), format))
      throw UsageError("option 'to': `" + format + "` is none of " + Join(KnownFormats(), ", "));
  }
  if (formats.empty()) throw UsageError("option 'to': name at least one of " + Join(KnownFormats(), ", "));
  if (options.opensim && !has(formats, "trc")) throw UsageError("option 'opensim' needs trc among the formats of option 'to'");
  if (options.fill_frames < 0) throw UsageError("option 'fill' must not be negative");
  if (options.rate_hz != 0 && !dataset::IsFrameRate(options.rate_hz))
    throw UsageError(std::string("option 'frame-rate' ") + dataset::kFrameRates);
  markers::ParseFilter(options.filter);
}

MarkerWork FilledAndFiltered(markers::MarkerTake take, const MarkerOptions& options) {
  MarkerWork work;
  work.before = std::move(take);
  work.after = work.before;
  work.filled = FillGaps(options.fill_frames, &work.after);
  markers::Filter(markers::ParseFilter(options.filter), &work.after);
  return work;
}

void CheckMarkerWorld(const std::string& world, const MarkerOptions& options, CommandResult* result) {
  const std::vector<std::string> formats = FormatsOf(options);
  const auto has = [&](const char* word) { return std::find(formats.begin(), formats.end(), word) != formats.end(); };
  const bool y_up = options.opensim || has("trc") || has("sto");
  if (!y_up || world.find("axes of camera ") == std::string::npos) return;
  result->warnings.push_back({"MRK-WORLD", "a .trc has y up, but nothing is up in the world of these joints: " + world,
                              "move the rig onto the floor (mvstudio calib align) and triangulate again"});
}

std::vector<MarkerWork> PrepareMarkers(const dataset::Pose3d& pose, const MarkerOptions& options, const std::string& path) {
  std::vector<MarkerWork> list;
  for (markers::MarkerTake& take : markers::MarkersOf(pose, options.rate_hz))
    list.push_back(FilledAndFiltered(std::move(take), options));
  if (list.empty()) throw FormatError(path, "", "no joint of anybody has a position");
  return list;
}

dataset::Pose3d PoseOf(const std::vector<MarkerWork>& work) {
  dataset::Pose3d pose;
  for (const MarkerWork& person : work) {
    const markers::MarkerTake& take = person.after;
    for (int f = 0; f < take.num_frames(); ++f) {
      for (int m = 0; m < take.num_markers(); ++m) {
        const Eigen::Vector3d& x_in_world = take.x_in_world[take.Index(f, m)];
        if (!x_in_world.allFinite()) continue;
        pose.rows.push_back(
            {take.first_frame + f, take.person, take.names[static_cast<size_t>(m)], Status::kOk, x_in_world, 0, 0, 0, {}});
      }
    }
  }
  return pose;
}

void WriteMarkers(const std::vector<MarkerWork>& work, const dataset::Pose3d& pose, const MarkerOptions& options,
                  const std::string& folder, const std::string& final_folder, CommandResult* result) {
  Writer writer(folder, final_folder, result);
  ordered_json persons = ordered_json::array();
  const geometry::Skeleton skeleton = SkeletonOf(pose);
  const bool with_bvh = Wants(options, "bvh") && HasHierarchy(skeleton, result);
  for (const MarkerWork& person : work) {
    WritePerson(person, options, &writer);
    if (options.opensim) SayWhatOpenSimLacks(person.after, result);
    persons.push_back(WorkJson(person));
    result->text += Line(persons.back(), options.fill_frames > 0) + "\n";
    if (with_bvh) WriteBvhFile(person, skeleton, &writer, &persons.back(), result);
    if (Wants(options, "angles")) WriteAngles(person, pose, &writer, &persons.back(), result);
  }
  writer.Write("markers.html", MarkerPage(work, options), "report");
  result->metrics["markers"] = {{"filter", ToText(markers::ParseFilter(options.filter))},
                                {"rate_hz", options.rate_hz},
                                {"fill_frames", options.fill_frames},
                                {"persons", persons}};
}

}  // namespace mvstudio::stages
