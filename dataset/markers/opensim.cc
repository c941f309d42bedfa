#include "dataset/markers/opensim.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <utility>

#include "core/format.h"

namespace mvstudio::markers {
namespace {

struct Place {
  const char* marker;
  const char* body;
  double x, y, z;  ///< metres in the body: x forward, y up, z to the right
  bool is_joint;
};

/// MidHip is between the model's hips, which lie at (-0.056276, -0.07849, +-0.07726) in its pelvis (Rajagopal2015.osim). Where
/// a neck is depends on the detector: it is free to be moved.
constexpr std::array<Place, 26> kPlaces = {{{"MidHip", "pelvis", -0.056276, -0.07849, 0, true},
                                            {"RHip", "femur_r", 0, 0, 0, true},
                                            {"LHip", "femur_l", 0, 0, 0, true},
                                            {"RKnee", "tibia_r", 0, 0, 0, true},
                                            {"LKnee", "tibia_l", 0, 0, 0, true},
                                            {"RAnkle", "talus_r", 0, 0, 0, true},
                                            {"LAnkle", "talus_l", 0, 0, 0, true},
                                            {"RHeel", "calcn_r", -0.01, 0.02, 0, false},
                                            {"LHeel", "calcn_l", -0.01, 0.02, 0, false},
                                            {"RBigToe", "toes_r", 0.06, 0, -0.02, false},
                                            {"LBigToe", "toes_l", 0.06, 0, 0.02, false},
                                            {"RSmallToe", "toes_r", 0.02, 0, 0.05, false},
                                            {"LSmallToe", "toes_l", 0.02, 0, -0.05, false},
                                            {"Neck", "torso", -0.01, 0.42, 0, false},
                                            {"RShoulder", "humerus_r", 0, 0, 0, true},
                                            {"LShoulder", "humerus_l", 0, 0, 0, true},
                                            {"RElbow", "ulna_r", 0, 0, 0, true},
                                            {"LElbow", "ulna_l", 0, 0, 0, true},
                                            {"RWrist", "hand_r", 0, 0, 0, true},
                                            {"LWrist", "hand_l", 0, 0, 0, true},
                                            {"Head", "torso", 0, 0.72, 0, false},
                                            {"Nose", "torso", 0.09, 0.58, 0, false},
                                            {"REye", "torso", 0.08, 0.62, 0.03, false},
                                            {"LEye", "torso", 0.08, 0.62, -0.03, false},
                                            {"REar", "torso", 0.01, 0.60, 0.075, false},
                                            {"LEar", "torso", 0.01, 0.60, -0.075, false}}};

struct Segment {
  const char* name;
  std::vector<std::array<const char*, 2>> pairs;
  std::vector<const char*> bodies;
  const char* axes;
};

const std::vector<Segment>& Segments() {
  static const std::vector<Segment> segments = {
      {"pelvis_width", {{"RHip", "LHip"}}, {"pelvis"}, "X Z"},
      {"torso_height", {{"RHip", "RShoulder"}, {"LHip", "LShoulder"}}, {"torso"}, "X Y"},
      {"shoulders", {{"RShoulder", "LShoulder"}}, {"torso"}, "Z"},
      {"thigh_r", {{"RHip", "RKnee"}}, {"femur_r", "patella_r"}, "X Y Z"},
      {"thigh_l", {{"LHip", "LKnee"}}, {"femur_l", "patella_l"}, "X Y Z"},
      {"shank_r", {{"RKnee", "RAnkle"}}, {"tibia_r", "talus_r"}, "X Y Z"},
      {"shank_l", {{"LKnee", "LAnkle"}}, {"tibia_l", "talus_l"}, "X Y Z"},
      {"foot_r", {{"RHeel", "RBigToe"}}, {"calcn_r", "toes_r"}, "X Y Z"},
      {"foot_l", {{"LHeel", "LBigToe"}}, {"calcn_l", "toes_l"}, "X Y Z"},
      {"upper_arm_r", {{"RShoulder", "RElbow"}}, {"humerus_r"}, "X Y Z"},
      {"upper_arm_l", {{"LShoulder", "LElbow"}}, {"humerus_l"}, "X Y Z"},
      {"forearm_r", {{"RElbow", "RWrist"}}, {"ulna_r", "radius_r", "hand_r"}, "X Y Z"},
      {"forearm_l", {{"LElbow", "LWrist"}}, {"ulna_l", "radius_l", "hand_l"}, "X Y Z"}};
  return segments;
}

bool Has(const std::vector<std::string>& names, const std::string& name) {
  return std::find(names.begin(), names.end(), name) != names.end();
}

std::vector<Place> PlacesOf(const std::vector<std::string>& names) {
  std::vector<Place> places;
  for (const Place& place : kPlaces) {
    if (Has(names, place.marker)) places.push_back(place);
  }
  return places;
}

std::string Document(const std::string& content) {
  return "<?xml version=\"1.0\" encoding=\"UTF-8\" ?>\n<OpenSimDocument Version=\"40000\">\n" + content +
         "</OpenSimDocument>\n";
}

/// A file's name in XML.
std::string Escaped(const std::string& text) {
  std::string escaped;
  for (const char c : text) {
    if (c == '&')
      escaped += "&amp;";
    else if (c == '<')
      escaped += "&lt;";
    else if (c == '>')
      escaped += "&gt;";
    else
      escaped += c;
  }
  return escaped;
}

std::string TimeRange(const MarkerTake& take, int first, int last) {
  return Format("<time_range> %.9g %.9g</time_range>", first / take.rate_hz, last / take.rate_hz);
}

std::string WholeRange(const MarkerTake& take) { return TimeRange(take, 0, std::max(0, take.num_frames() - 1)); }

/// How far the markers have moved from `first` to `last`, squared metres, and how many of them lack either.
struct Motion {
  int num_missing = 0;
  double moved_m2 = 0;
};

Motion MotionBetween(const MarkerTake& take, const std::vector<int>& markers, int first, int last) {
  Motion motion;
  for (const int m : markers) {
    const double moved = (take.x_in_world[take.Index(last, m)] - take.x_in_world[take.Index(first, m)]).squaredNorm();
    motion.num_missing += !std::isfinite(moved);
    motion.moved_m2 += std::isfinite(moved) ? moved : 0;
  }
  return motion;
}

/// The half second in which the placed markers move least. The marker placer averages positions over it: over a whole motion
/// that would be nobody's posture.
std::string StillRange(const MarkerTake& take) {
  std::vector<int> markers;
  for (int m = 0; m < take.num_markers(); ++m) {
    if (!PlacesOf({take.names[static_cast<size_t>(m)]}).empty()) markers.push_back(m);
  }
  const int count =
      std::clamp(static_cast<int>(std::lround(std::min(take.rate_hz / 2, 1e6))), 1, std::max(1, take.num_frames()));
  int best = 0;
  std::pair<int, double> least(std::numeric_limits<int>::max(), 0);
  for (int first = 0; first + count <= take.num_frames(); ++first) {
    std::pair<int, double> cost(0, 0);
    for (const int later : {count / 4, count / 2, count - 1}) {
      const Motion motion = MotionBetween(take, markers, first, first + later);
      cost.first += motion.num_missing, cost.second += motion.moved_m2;
    }
    if (cost < least) least = cost, best = first;
  }
  return TimeRange(take, best, best + count - 1);
}

std::string MarkerTasks(const std::vector<std::string>& names, const std::string& indent) {
  std::string text;
  for (const Place& place : PlacesOf(names)) {
    text += Format("%s<IKMarkerTask name=\"%s\"><apply>true</apply><weight>%g</weight></IKMarkerTask>\n", indent.c_str(),
                   place.marker, place.is_joint ? 1.0 : 0.5);
  }
  return text;
}

/// Empty where the take lacks one of the markers of every pair.
std::string Measurement(const Segment& segment, const std::vector<std::string>& names) {
  std::string pairs, bodies;
  for (const auto& [a, b] : segment.pairs) {
    if (Has(names, a) && Has(names, b)) pairs += Format("<MarkerPair><markers> %s %s</markers></MarkerPair>", a, b);
  }
  if (pairs.empty()) return "";
  for (const char* body : segment.bodies) {
    bodies += Format("<BodyScale name=\"%s\"><axes> %s</axes></BodyScale>", body, segment.axes);
  }
  return Format(
      "     <Measurement name=\"%s\">\n      <apply>true</apply>\n      <MarkerPairSet><objects>%s</objects></MarkerPairSet>\n"
      "      <BodyScaleSet><objects>%s</objects></BodyScaleSet>\n     </Measurement>\n",
      segment.name, pairs.c_str(), bodies.c_str());
}

std::string ScaledModel(const std::string& stem) { return Escaped(stem) + ".scaled.osim"; }

}  // namespace

std::vector<std::string> OpenSimMarkers(const std::vector<std::string>& names) {
  std::vector<std::string> markers;
  for (const Place& place : PlacesOf(names)) markers.emplace_back(place.marker);
  return markers;
}

std::string OpenSimMarkerSet(const std::vector<std::string>& names) {
  std::string text = " <MarkerSet name=\"markers\">\n  <objects>\n";
  for (const Place& place : PlacesOf(names)) {
    text += Format(
        "   <Marker name=\"%s\">\n    <socket_parent_frame>/bodyset/%s</socket_parent_frame>\n"
        "    <location>%g %g %g</location>\n    <fixed>%s</fixed>\n   </Marker>\n",
        place.marker, place.body, place.x, place.y, place.z, place.is_joint ? "true" : "false");
  }
  return Document(text + "  </objects>\n  <groups />\n </MarkerSet>\n");
}

std::string OpenSimScaling(const MarkerTake& take, const std::string& stem) {
  std::string measurements;
  for (const Segment& segment : Segments()) measurements += Measurement(segment, take.names);
  const std::string file = Escaped(stem) + ".trc", scaled = ScaledModel(stem);
  return Document(
      " <ScaleTool name=\"subject\">\n  <mass>-1</mass>\n  <height>-1</height>\n  <age>-1</age>\n  <GenericModelMaker>\n"
      "   <model_file>Rajagopal2015.osim</model_file>\n   <marker_set_file>" +
      Escaped(stem) +
      ".markers.xml</marker_set_file>\n  </GenericModelMaker>\n  <ModelScaler>\n   <apply>true</apply>\n"
      "   <scaling_order> measurements</scaling_order>\n   <MeasurementSet>\n    <objects>\n" +
      measurements + "    </objects>\n   </MeasurementSet>\n   <marker_file>" + file + "</marker_file>\n   " +
      WholeRange(take) + "\n   <preserve_mass_distribution>true</preserve_mass_distribution>\n   <output_model_file>" + scaled +
      "</output_model_file>\n  </ModelScaler>\n  <MarkerPlacer>\n   <apply>true</apply>\n   <IKTaskSet>\n    <objects>\n" +
      MarkerTasks(take.names, "     ") + "    </objects>\n   </IKTaskSet>\n   <marker_file>" + file + "</marker_file>\n   " +
      StillRange(take) + "\n   <output_model_file>" + scaled +
      "</output_model_file>\n   <max_marker_movement>-1</max_marker_movement>\n  </MarkerPlacer>\n </ScaleTool>\n");
}

std::string OpenSimInverseKinematics(const MarkerTake& take, const std::string& stem) {
  return Document(std::string(" <InverseKinematicsTool name=\"subject\">\n  <model_file>") + ScaledModel(stem) +
                  "</model_file>\n  <constraint_weight>Inf</constraint_weight>\n  <accuracy>1e-05</accuracy>\n  <IKTaskSet>\n"
                  "   <objects>\n" +
                  MarkerTasks(take.names, "    ") + "   </objects>\n  </IKTaskSet>\n  <marker_file>" + Escaped(stem) +
                  ".trc</marker_file>\n  " + WholeRange(take) +
                  "\n  <report_errors>true</report_errors>\n  <output_motion_file>" + Escaped(stem) +
                  ".ik.mot</output_motion_file>\n </InverseKinematicsTool>\n");
}

}  // namespace mvstudio::markers
