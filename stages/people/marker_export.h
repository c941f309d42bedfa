#pragma once

#include <map>
#include <optional>
#include <string>
#include <vector>

#include "dataset/markers/fill.h"
#include "dataset/markers/filter.h"
#include "dataset/markers/gait_events.h"
#include "dataset/markers/marker_files.h"
#include "dataset/markers/marker_take.h"
#include "dataset/pose/pose3d.h"
#include "stages/result.h"

/// 3D joints -> files of biomechanics programs, filled and filtered.
namespace mvstudio::stages {

struct MarkerOptions {
  std::string to;  ///< words of trc, c3d, csv, wide, npz, sto, bvh, angles with commas between them; empty: nothing is written
  double rate_hz = 0;           ///< 0: that of the points
  std::string filter = "none";  ///< markers::ParseFilter
  int fill_frames = 0;
  markers::TrcUnit trc_unit = markers::TrcUnit::kMillimetre;
  bool opensim = false;  ///< marker set, scaling and inverse kinematics beside each .trc
};

template <class Visitor>
void VisitFields(Visitor&& visit, MarkerOptions& o) {
  visit("to", o.to,
        "trc,c3d,csv,wide,npz,sto,bvh,angles: files that are written, one per person, with every joint; wide: a table with a "
        "row per "
        "frame; bvh has bones of one length; angles: joint angles (.csv and OpenSim's .mot)");
  visit("frame-rate", o.rate_hz,
        "frames a second of the take, e.g. 60; pose3d.json keeps it; what the input states unless given");
  visit("filter", o.filter,
        "butterworth:6Hz (fourth order, no delay), kalman (smoother that knows each point's sigma), gaussian:0.02s, median:5 "
        "(frames) or none");
  visit("fill", o.fill_frames, "gaps of at most so many frames are filled and marked; 0: none");
  visit("trc-unit", o.trc_unit, "mm or m: unit of the lengths in .trc files, which their headers state");
  visit("opensim", o.opensim, "write marker set, scaling and inverse kinematics for OpenSim 4 beside each .trc");
}

/// Throws UsageError where nothing is to be written, for unknown formats, filters, rates (0: not known yet) and lengths.
void CheckMarkerOptions(const MarkerOptions& options);

/// A person before and after.
struct MarkerWork {
  markers::MarkerTake before, after;
  markers::FillReport filled;
};

/// One of them, by the options' gaps and filter.
MarkerWork FilledAndFiltered(markers::MarkerTake take, const MarkerOptions& options);

/// Every person of the take. Throws FormatError when nobody has a position.
std::vector<MarkerWork> PrepareMarkers(const dataset::Pose3d& pose, const MarkerOptions& options, const std::string& path);

/// Positions after filling and filtering, all persons together: what the files hold.
dataset::Pose3d PoseOf(const std::vector<MarkerWork>& work);

/// Joint angles of one person as files, and what there is to say of them.
struct AngleReport {
  struct Angle {
    std::string name;
    int num_frames = 0;                                     ///< with a value
    std::map<std::string, int> missing;                     ///< frames without one, by reason
    double min_deg = 0, max_deg = 0, median_sigma_deg = 0;  ///< NaN: no sigma is known
  };
  std::vector<Angle> angles;
  int num_frames = 0;
};
struct AngleFiles {
  std::string csv, mot;
  AngleReport report;
};
/// `pose`: the joints as triangulated, for their covariances; its world says whether anything is up.
AngleFiles AnglesOfPerson(const markers::MarkerTake& take, const dataset::Pose3d& pose, const std::string& name);

struct GaitOfPerson {
  int person = 0;
  markers::GaitReport report;
  std::string file;  ///< empty without events
};
/// Gait events of every person: writes person<N>.events.csv where there are some.
std::vector<GaitOfPerson> WriteGaitEvents(const std::vector<MarkerWork>& work, const dataset::Pose3d& pose,
                                          const std::string& folder, const std::string& final_folder);

/// Another file of the same points.
struct ConvertOptions {
  std::string to;        ///< trc, c3d, bvh, csv, wide, npz, sto, pose3d; empty: as the output's name ends
  std::string unit, up;  ///< of the output; empty: the format's custom
  int person = -1;       ///< -1: the only one, or with a folder all
};
/// A file of markers that was written, as it will be called in the end.
struct MarkerFileWritten {
  std::string path, role;
};
/// What bones of one length leave of positions.
struct BvhFit {
  size_t num_joints = 0;
  double rms_m = 0, max_m = 0;
  int num_held = 0;  ///< frames without a root
};
struct ConvertReport {
  std::string format, unit, up;
  struct Person {
    int person = 0, num_frames = 0, num_markers = 0;
    std::vector<std::string> not_held;  ///< what the format cannot hold
    std::optional<BvhFit> bvh;
  };
  std::vector<Person> persons;
  std::vector<MarkerFileWritten> files;
};
bool IsFileOfFormat(const ConvertOptions& options, const std::string& out);
std::string ConvertFormat(const ConvertOptions& options, const std::string& out);
/// Writes `out`, a file where its name ends as those of the format, else a folder with person<N>.EXT; `work_folder`: where that
/// folder grows. `input`: where the points come from. Throws UsageError for several persons and one file, and for what the
/// format has no place for.
ConvertReport ConvertMarkers(const dataset::Pose3d& pose, const std::string& input, const ConvertOptions& options,
                             const std::string& out, const std::string& work_folder);

/// What was written of a take.
struct MarkerReport {
  struct Person {
    int person = 0, first_frame = 0, num_frames = 0;
    std::vector<std::string> names;  ///< of the markers
    markers::FillReport filled;
    std::vector<markers::MarkerMotion> before, after;
    markers::Displacement moved;
    std::vector<std::string> not_in_opensim;  ///< joints that its files leave out
    std::optional<BvhFit> bvh;
    std::optional<AngleReport> angles;
  };
  MarkerOptions options;
  std::string world;  ///< of the joints: Pose3d::world
  std::vector<Person> persons;
  bool without_bones = false;  ///< a .bvh was asked for and not written
  std::vector<MarkerFileWritten> files;
};

/// Writes person<N>.trc, .c3d, .csv, .bvh, the files for OpenSim and markers.html into the folder. `pose` is what the markers
/// were made of. Files are reported as they will be called below `final_folder`.
MarkerReport WriteMarkers(const std::vector<MarkerWork>& work, const dataset::Pose3d& pose, const MarkerOptions& options,
                          const std::string& folder, const std::string& final_folder);

/// Metrics `markers` and a line of text for each person; warnings of joints that OpenSim's files leave out, and of a skeleton
/// without bones, which has no hierarchy: the result is then partial (exit 6).
CommandResult DescribeMarkers(const MarkerReport& report);

/// A warning "MRK-WORLD" where the joints' world (Pose3d::world) is that of a camera, and a file that says y up is written.
std::vector<Notice> MarkerWorldConflicts(const std::string& world, const MarkerOptions& options);

/// Curves of every joint before and after, as a page; of long takes the middle.
std::string MarkerPage(const std::vector<MarkerWork>& work, const MarkerOptions& options);

}  // namespace mvstudio::stages
