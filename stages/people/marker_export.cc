#include "stages/people/marker_export.h"

#include <algorithm>
#include <filesystem>
#include <sstream>

#include "core/disk/files.h"
#include "core/error.h"
#include "core/join.h"
#include "dataset/footage/frame_rate.h"
#include "dataset/markers/bvh.h"
#include "dataset/markers/marker_files.h"
#include "dataset/markers/opensim.h"

namespace mvstudio::stages {
namespace {

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

/// Writes into a folder that gets its final name later.
class Writer {
 public:
  Writer(std::string folder, std::string final_folder, std::vector<MarkerFileWritten>* files)
      : folder_(std::move(folder)), final_folder_(std::move(final_folder)), files_(files) {}

  void Write(const std::string& name, const std::string& content, const std::string& role = "") {
    WriteFileAtomic((std::filesystem::path(folder_) / name).string(), content);
    files_->push_back({(std::filesystem::path(final_folder_) / name).string(), role});
  }

 private:
  std::string folder_, final_folder_;
  std::vector<MarkerFileWritten>* files_;
};

void WriteOpenSim(const markers::MarkerTake& take, const std::string& stem, Writer* writer) {
  writer->Write(stem + ".markers.xml", markers::OpenSimMarkerSet(take.names));
  writer->Write(stem + ".scale.xml", OpenSimScaling(take, stem));
  writer->Write(stem + ".ik.xml", OpenSimInverseKinematics(take, stem));
}

std::vector<std::string> NotInOpenSim(const markers::MarkerTake& take) {
  const std::vector<std::string> known = markers::OpenSimMarkers(take.names);
  std::vector<std::string> lacking;
  for (const std::string& name : take.names) {
    if (std::find(known.begin(), known.end(), name) == known.end()) lacking.push_back(name);
  }
  return lacking;
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

AngleReport WriteAngles(const MarkerWork& work, const dataset::Pose3d& pose, Writer* writer) {
  const std::string stem = "person" + std::to_string(work.after.person);
  AngleFiles files = AnglesOfPerson(work.after, pose, stem);
  writer->Write(stem + ".angles.csv", files.csv, "angles");
  writer->Write(stem + ".angles.mot", files.mot, "angles");
  return std::move(files.report);
}

BvhFit WriteBvhFile(const MarkerWork& work, const geometry::Skeleton& skeleton, Writer* writer) {
  const markers::MarkerBody hung = markers::HungFromPelvis(work.after, skeleton);
  const markers::BvhMotion motion = FitBvh(hung.take, hung.skeleton);
  writer->Write("person" + std::to_string(work.after.person) + ".bvh", BvhText(motion, hung.skeleton, work.after.rate_hz),
                "markers");
  return {hung.skeleton.joints.size(), motion.rms_m, motion.max_m, motion.num_held};
}

MarkerReport::Person ReportOf(const MarkerWork& work) {
  MarkerReport::Person person;
  person.person = work.after.person, person.first_frame = work.after.first_frame, person.num_frames = work.after.num_frames();
  person.names = work.after.names, person.filled = work.filled;
  person.before = MeasureMotion(work.before), person.after = MeasureMotion(work.after);
  person.moved = MeasureDisplacement(work.before, work.after);
  return person;
}

}  // namespace

void CheckMarkerOptions(const MarkerOptions& options) {
  const std::vector<std::string> formats = FormatsOf(options);
  const auto has = [](const std::vector<std::string>& list, const std::string& word) {
    return std::find(list.begin(), list.end(), word) != list.end();
  };
  for (const std::string& format : formats) {
    if (!has(KnownFormats(), format))
      throw UsageError("option 'to': `" + format + "` is none of " + Join(KnownFormats(), ", ") +
                       (format == "mot" ? "; angles writes the .mot" : ""));
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

std::vector<Notice> MarkerWorldConflicts(const std::string& world, const MarkerOptions& options) {
  const bool y_up = options.opensim || Wants(options, "trc") || Wants(options, "sto");
  if (!y_up || world.find("axes of camera ") == std::string::npos) return {};
  return {{"MRK-WORLD", "a .trc has y up, but nothing is up in the world of these joints: " + world,
           "move the rig onto the floor (mvstudio calib align) and triangulate again"}};
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

MarkerReport WriteMarkers(const std::vector<MarkerWork>& work, const dataset::Pose3d& pose, const MarkerOptions& options,
                          const std::string& folder, const std::string& final_folder) {
  MarkerReport report;
  report.options = options, report.world = pose.world;
  Writer writer(folder, final_folder, &report.files);
  const geometry::Skeleton skeleton = SkeletonOf(pose);
  const bool with_bvh = Wants(options, "bvh");
  report.without_bones = with_bvh && skeleton.bones.empty();
  for (const MarkerWork& each : work) {
    WritePerson(each, options, &writer);
    MarkerReport::Person& person = report.persons.emplace_back(ReportOf(each));
    if (options.opensim) person.not_in_opensim = NotInOpenSim(each.after);
    if (with_bvh && !report.without_bones) person.bvh = WriteBvhFile(each, skeleton, &writer);
    if (Wants(options, "angles")) person.angles = WriteAngles(each, pose, &writer);
  }
  writer.Write("markers.html", MarkerPage(work, options), "report");
  return report;
}

}  // namespace mvstudio::stages
