#include "dataset/markers/opensim.h"

#include <cmath>
#include <cstdlib>

#include "core/disk/files.h"
#include "dataset/markers/marker_files.h"
#include "tests/support/run_cli.h"
#include "tests/support/temp_dir.h"
#include "tests/support/test.h"

namespace mvstudio::markers {
namespace {

const std::vector<std::string>& BodyJoints() {
  static const std::vector<std::string> names = {"Nose",   "Neck",    "RShoulder", "RElbow", "RWrist", "LShoulder", "LElbow",
                                                 "LWrist", "MidHip",  "RHip",      "RKnee",  "RAnkle", "LHip",      "LKnee",
                                                 "LAnkle", "REye",    "LEye",      "REar",   "LEar",   "LBigToe",   "LSmallToe",
                                                 "LHeel",  "RBigToe", "RSmallToe", "RHeel"};
  return names;
}

/// Everything moves with 1 m/s but for the frames 40 to 80, of 120 at 50 Hz.
MarkerTake Walk(const std::vector<std::string>& names) {
  MarkerTake take;
  take.rate_hz = 50, take.names = names;
  for (int f = 0; f < 120; ++f) {
    const double walked_m = 0.02 * (std::min(f, 40) + std::max(0, f - 80));
    for (size_t m = 0; m < names.size(); ++m) {
      take.x_in_world.push_back({walked_m, 0.1 * static_cast<double>(m), 1 + std::sin(static_cast<double>(m))});
      take.source.push_back(Source::kMeasured);
      take.sigma_m.push_back(0);
    }
  }
  return take;
}

/// The files of one person, and what tests/clients/opensim_reader.py says of them.
std::string Faults(const MarkerTake& take, const TempDir& folder) {
  const std::string stem = "person" + std::to_string(take.person);
  const std::string set = OpenSimMarkerSet(take.names), scaling = OpenSimScaling(take, stem);
  WriteFileAtomic(folder / (stem + ".trc"), TrcText(take, stem + ".trc"));
  WriteFileAtomic(folder / (stem + ".markers.xml"), set);
  WriteFileAtomic(folder / (stem + ".scale.xml"), scaling);
  WriteFileAtomic(folder / (stem + ".ik.xml"), OpenSimInverseKinematics(take, stem));
  const char* source = std::getenv("MVSTUDIO_SOURCE");
  const std::string line = "python3 -B " + ShellQuote(std::string(source ? source : ".") + "/tests/clients/opensim_reader.py") +
                           " " + ShellQuote(folder / stem) + " >" + ShellQuote(folder / "faults") + " 2>&1";
  const int status = std::system(line.c_str());
  return Slurp(folder / "faults") + (status == 0 ? "" : "exit " + std::to_string(status));
}

TEST(OpenSim, PlacesOnlyWhatTheModelHas) {
  EXPECT_THAT(OpenSimMarkers({"RHip", "Tail", "RKnee"}), ElementsAre("RHip", "RKnee"));
  const std::string set = OpenSimMarkerSet({"RHip", "Tail", "RKnee"});
  EXPECT_THAT(set, HasSubstr("/bodyset/tibia_r"));
  EXPECT_EQ(set.find("Tail"), std::string::npos);
  const MarkerTake take = Walk({"RHip"});
  EXPECT_EQ(OpenSimScaling(take, "a").find("<Measurement "), std::string::npos);  // one marker measures nothing
  EXPECT_THAT(OpenSimInverseKinematics(take, "a&b"), HasSubstr("a&amp;b.trc"));
  EXPECT_THAT(OpenSimInverseKinematics(take, "a"), HasSubstr("<time_range> 0 2.38</time_range>"));
}

TEST(OpenSim, FilesFitItsClassesTheMarkersAndTheModel) {
  const TempDir folder;
  EXPECT_EQ(Faults(Walk(BodyJoints()), folder), "");
  std::vector<std::string> few = {"RHip", "LHip", "RKnee", "Tail"};
  MarkerTake take = Walk(few);
  take.person = 1;
  EXPECT_EQ(Faults(take, folder), "");
}

TEST(OpenSim, TheReaderSeesWhatDoesNotFit) {
  const TempDir folder;
  ASSERT_EQ(Faults(Walk(BodyJoints()), folder), "");
  const std::string scale = Slurp(folder / "person0.scale.xml"), set = Slurp(folder / "person0.markers.xml");
  const auto reread = [&](const std::string& name, std::string text, const std::string& from, const std::string& to) {
    const size_t at = text.find(from);
    if (at == std::string::npos) return "`" + from + "` is not there";
    WriteFileAtomic(folder / name, text.replace(at, from.size(), to));
    const char* source = std::getenv("MVSTUDIO_SOURCE");
    const std::string line = "python3 -B " +
                             ShellQuote(std::string(source ? source : ".") + "/tests/clients/opensim_reader.py") + " " +
                             ShellQuote(folder / "person0") + " >" + ShellQuote(folder / "faults") + " 2>&1";
    EXPECT_NE(std::system(line.c_str()), 0);
    return Slurp(folder / "faults");
  };
  EXPECT_THAT(reread("person0.scale.xml", scale, "<apply>true", "<apply>yes"), HasSubstr("`yes` is no bool"));
  EXPECT_THAT(
      reread("person0.scale.xml", scale, "<max_marker_movement>-1</max_marker_movement>", "<max_movement>-1</max_movement>"),
      HasSubstr("person0.scale.xml: MarkerPlacer.max_movement is no property"));
  EXPECT_THAT(reread("person0.scale.xml", scale, "<scaling_order>", "<scalingOrder>"), HasSubstr("mismatched tag"));
  EXPECT_THAT(reread("person0.scale.xml", scale, "BodyScale name=\"pelvis\"", "BodyScale name=\"Pelvis\""),
              HasSubstr("Pelvis"));
  EXPECT_THAT(reread("person0.scale.xml", scale, " RHip LHip", " RHip Tail"), HasSubstr("Tail"));
  EXPECT_THAT(reread("person0.scale.xml", scale, "0 2.38</time_range>", "0 9</time_range>"), HasSubstr("time_range"));
  WriteFileAtomic(folder / "person0.scale.xml", scale);
  EXPECT_THAT(reread("person0.markers.xml", set, "Marker name=\"RHip\"", "Marker name=\"hip\""), HasSubstr("hip"));
  EXPECT_THAT(reread("person0.markers.xml", set, "/bodyset/femur_r", "femur_r"), HasSubstr("femur_r"));
}

TEST(OpenSim, MarkersArePlacedWhereThePersonStandsStill) {
  MarkerTake take = Walk(BodyJoints());
  // Still between 0.8 s and 1.6 s; half a second of it.
  EXPECT_THAT(OpenSimScaling(take, "a"), HasSubstr("<time_range> 0.8 1.28</time_range>\n   <output_model_file>"));
  for (int f = 40; f < 60; ++f) take.x_in_world[take.Index(f, 3)].setConstant(std::nan(""));
  EXPECT_THAT(OpenSimScaling(take, "a"), HasSubstr("<time_range> 1.2 1.68</time_range>\n   <output_model_file>"));
}

TEST(OpenSim, EachPersonHasAModelOfTheirOwn) {
  const MarkerTake take = Walk(BodyJoints());
  EXPECT_THAT(OpenSimScaling(take, "person0"), HasSubstr("person0.scaled.osim"));
  EXPECT_THAT(OpenSimInverseKinematics(take, "person1"), HasSubstr("<model_file>person1.scaled.osim</model_file>"));
  EXPECT_THAT(OpenSimInverseKinematics(take, "person1"), HasSubstr("person1.ik.mot"));
}

TEST(OpenSim, OneFrameAndNothingMeasuredAreRanges) {
  MarkerTake take = Walk({"RHip", "LHip"});
  take.x_in_world.resize(2), take.source.resize(2), take.sigma_m.resize(2);
  EXPECT_THAT(OpenSimScaling(take, "a"), HasSubstr("<time_range> 0 0</time_range>\n   <output_model_file>"));
  for (auto& x : take.x_in_world) x.setConstant(std::nan(""));
  EXPECT_THAT(OpenSimScaling(take, "a"), HasSubstr("<time_range> 0 0</time_range>\n   <output_model_file>"));
}

}  // namespace
}  // namespace mvstudio::markers
