#include <algorithm>
#include <cmath>
#include <set>

#include "dataset/json/json_file.h"
#include "dataset/panoptic/time.h"
#include "dataset/verify/findings.h"
#include "dataset/verify/verify_steps.h"

namespace mvstudio::dataset::internal {
namespace {

/// Findings that many files share: the first is named, the others are counted.
struct Shared {
  int count = 0;
  std::string path, text;
  void Add(const std::string& where, const std::string& what) {
    if (++count == 1) path = where, text = what;
  }
  void Report(const std::string& code, bool error, Findings* findings) const {
    if (count == 0) return;
    const std::string all = text + (count > 1 ? "; and " + std::to_string(count - 1) + " more like it" : "");
    error ? findings->Error(code, path, all) : findings->Warning(code, path, all);
  }
};

/// Lengths between joints that every adult and child has, metres.
bool PlausiblePerson(const Coco19Pose& pose, double* length_m) {
  if (!pose.valid[0] || !pose.valid[2]) return true;
  *length_m = (pose.x_in_world.col(0) - pose.x_in_world.col(2)).norm();
  return *length_m > 0.15 && *length_m < 1.0;
}

struct SceneFaults {
  Shared implausible, confidence, fps_type, skeleton, without_numbers;
};

void CheckPlausible(const Body3dScene& scene, const std::string& path, Shared* implausible) {
  for (const auto& [id, pose] : scene.people) {
    double length_m = 0;
    if (PlausiblePerson(pose, &length_m)) continue;
    implausible->Add(path, "person " + std::to_string(id) + ": neck and body centre are " + NumberText(100 * length_m) +
                               " cm apart; Panoptic files are in centimetres");
  }
}

void CheckNumbers(const PanopticScene& scene, const std::string& path, SceneFaults* faults) {
  for (const PanopticBody& body : scene.bodies) {
    if (body.num_without_numbers > 0)
      faults->without_numbers.Add(path, "person " + std::to_string(body.id) + ": a null or NaN stands for a number in " +
                                            std::to_string(body.num_without_numbers) +
                                            " of the joints, which count as missing");
    for (size_t i = 3; i < body.joints19.size(); i += 4) {
      const double c = body.joints19[i];
      if (c == -1 || (c >= 0 && c <= 1)) continue;
      faults->confidence.Add(path, "person " + std::to_string(body.id) + ": a confidence is " + NumberText(c) +
                                       "; it is 0 to 1, or -1 for a joint that is not there");
      break;
    }
  }
  const std::string type = scene.fps_type.value_or("hd_29_97");
  if (type != "hd_29_97" && type != "vga_25")
    faults->fps_type.Add(path, "fpsType is " + Quoted(type) + "; readers know hd_29_97 and vga_25");
}

Body3dScene ReadScene(const std::string& path, SceneFaults* faults, bool* readable) {
  const PanopticScene file = ReadPanopticScene(path);
  CheckNumbers(file, path, faults);
  Body3dScene scene;
  scene.univ_time_ms = file.univ_time_ms.value_or(-1);
  scene.fps_type = file.fps_type.value_or("");
  PanopticScene with_joints19 = file;
  const auto other = [](const PanopticBody& b) { return b.id >= 0 && b.joints19.empty(); };
  *readable = std::none_of(file.bodies.begin(), file.bodies.end(), other);
  if (!*readable) faults->skeleton.Add(path, "a body has another skeleton than joints19, which is the one that is read");
  auto& bodies = with_joints19.bodies;
  bodies.erase(std::remove_if(bodies.begin(), bodies.end(), other), bodies.end());
  scene.people = ToCoco19(with_joints19, path);
  CheckPlausible(scene, path, &faults->implausible);
  return scene;
}

void CheckTimes(const std::map<int, Body3dScene>& scenes, const std::string& folder, Findings* findings) {
  std::map<int, double> times;
  bool grows = true;
  int before = 0;
  std::vector<int> without;
  for (const auto& [frame, scene] : scenes) {
    if (scene.univ_time_ms < 0) {
      without.push_back(frame);
      continue;
    }
    if (!times.empty() && scene.univ_time_ms <= times.rbegin()->second) {
      grows = false;
      findings->Error("DAT-TIME", folder,
                      "univTime does not grow from frame " + std::to_string(before) + " to " + std::to_string(frame));
    }
    times[frame] = scene.univ_time_ms, before = frame;
  }
  if (!times.empty() && !without.empty())
    findings->Warning("DAT-TIME", folder, "there is no univTime in " + FramesText(without));
  const PanopticClock clock = FitPanopticClock(std::move(times));
  if (grows && clock.known_ms.size() > 2 && !clock.is_line) {
    findings->Warning("DAT-TIME", folder,
                      "univTime is up to " + NumberText(clock.worst_ms) + " ms off a regular clock of " +
                          NumberText(clock.period_ms) + " ms a frame: frames dropped, doubled or renumbered?");
  }
}

void CheckGaps(const std::map<int, Body3dScene>& scenes, const std::string& folder, Findings* findings) {
  int gaps = 0, first_gap = 0;
  const std::pair<const int, Body3dScene>* before = nullptr;
  for (const auto& entry : scenes) {
    if (before && entry.first != before->first + 1 && ++gaps == 1) first_gap = before->first + 1;
    before = &entry;
  }
  if (gaps > 0) {
    findings->Warning("DAT-GAP", folder,
                      std::to_string(gaps) + " gaps in the frame numbers, the first at frame " + std::to_string(first_gap));
  }
}

struct LandmarkFaults {
  Shared twice, empty, strangers, far;
};

/// Distance of a part from the joint that it belongs to, metres; nothing where that is not known.
void CheckPart(const std::optional<PanopticLandmarks>& part, const std::map<int, Coco19Pose>& people, int id, int joint,
               const char* name, const std::string& path, LandmarkFaults* faults) {
  const auto person = people.find(id);
  if (!part || person == people.end() || !person->second.valid[joint]) return;
  if (part->average_score && MeanScore(*part) < 1e-3) return;  // the toolbox does not take those for real
  const Eigen::Vector3d middle = InWorld(*part).rowwise().mean();
  const double distance_m = (middle - person->second.x_in_world.col(joint)).norm();
  if (!(distance_m < 0.5)) {
    faults->far.Add(path, "person " + std::to_string(id) + ": the middle of " + name + " is " + NumberText(100 * distance_m) +
                              " cm from the body's joint; axes, units or another person?");
  }
}

void CheckPeople(const PanopticLandmarkFile& file, LandmarkKind kind, const std::map<int, Coco19Pose>* people,
                 const std::string& path, LandmarkFaults* faults) {
  std::set<int> ids;
  for (const PanopticLandmarkPerson& person : file.people) {
    if (person.id < 0) continue;
    const std::string who = "person " + std::to_string(person.id);
    if (!ids.insert(person.id).second) faults->twice.Add(path, who + " is there twice");
    const bool any = kind == LandmarkKind::kFaces ? person.face70.has_value() : person.left_hand || person.right_hand;
    if (!any) faults->empty.Add(path, who + (kind == LandmarkKind::kFaces ? " has no face70" : " has neither hand"));
    if (!people) continue;
    if (!people->count(person.id)) faults->strangers.Add(path, who + " is not in the body3DScene file of this frame");
    CheckPart(person.face70, *people, person.id, 1, "the face", path, faults);
    CheckPart(person.left_hand, *people, person.id, 5, "the left hand", path, faults);
    CheckPart(person.right_hand, *people, person.id, 11, "the right hand", path, faults);
  }
}

void CheckTrack(const PanopticSyncTrack& track, const std::string& path, Findings* findings) {
  std::string name;
  for (const std::string& key : track.place) name += (name.empty() ? "" : ".") + key;
  double before = -1;
  for (size_t i = 0; i < track.univ_time_ms.size(); ++i) {
    const double time = track.univ_time_ms[i];
    if (time < 0) continue;
    if (time <= before) {
      return findings->Error("DAT-SYNC", path, name + ".univ_time[" + std::to_string(i) + "]: does not grow");
    }
    before = time;
  }
  if (before < 0) findings->Warning("DAT-SYNC", path, name + ".univ_time: holds no time");
}

PanopticSyncTables ReadTables(const std::string& path, Findings* findings) {
  if (path.empty()) return {};
  try {
    PanopticSyncTables tables = ReadPanopticSyncTables(path);
    for (const PanopticSyncTrack& track : tables.tracks) CheckTrack(track, path, findings);
    return tables;
  } catch (const FormatError& error) {
    findings->Error("DAT-SYNC", path, WithoutPath(error));
    return {};
  }
}

}  // namespace

std::string FramesText(const std::vector<int>& frames) {
  std::string text = std::to_string(frames.size()) + (frames.size() == 1 ? " frame: " : " frames: ");
  for (size_t i = 0; i < std::min<size_t>(frames.size(), 5); ++i) text += (i ? ", " : "") + std::to_string(frames[i]);
  return text + (frames.size() > 5 ? ", …" : "");
}

std::map<int, Body3dScene> VerifyScenes(const PanopticFrames& frames, Findings* findings) {
  std::map<int, Body3dScene> scenes;
  SceneFaults faults;
  int without_people = 0;
  for (const auto& [frame, path] : frames.files) {
    try {
      bool readable = true;
      Body3dScene scene = ReadScene(path, &faults, &readable);
      if (!readable) continue;
      without_people += scene.people.empty();
      scenes[frame] = std::move(scene);
    } catch (const FormatError& error) {
      const bool twice = std::string(error.what()).find("is there twice") != std::string::npos &&
                         std::string(error.what()).find("the key") == std::string::npos;
      findings->Error(twice ? "DAT-ID" : "DAT-POSE", path, WithoutPath(error));
    } catch (const IoError& error) {
      findings->Error("DAT-POSE", path, error.what());
    }
  }
  faults.skeleton.Report("DAT-POSE", true, findings);
  faults.confidence.Report("DAT-JOINT", false, findings);
  faults.without_numbers.Report("DAT-JOINT", false, findings);
  faults.fps_type.Report("DAT-RATE", false, findings);
  faults.implausible.Report("DAT-UNITS", false, findings);
  if (!scenes.empty() && without_people == static_cast<int>(scenes.size()))
    findings->Error("DAT-POSE", frames.folder, "nobody is in any of its " + std::to_string(without_people) + " frames");
  else if (without_people > 0)
    findings->Warning("DAT-POSE", frames.folder, std::to_string(without_people) + " frames hold no person");
  CheckTimes(scenes, frames.folder, findings);
  CheckGaps(scenes, frames.folder, findings);
  return scenes;
}

int VerifyLandmarks(const PanopticFrames& frames, LandmarkKind kind, const std::map<int, Body3dScene>& scenes,
                    Findings* findings) {
  const std::string code = kind == LandmarkKind::kFaces ? "DAT-FACE" : "DAT-HAND";
  LandmarkFaults faults;
  Shared without_scene;
  int readable = 0;
  for (const auto& [frame, path] : frames.files) {
    const auto scene = scenes.find(frame);
    if (scene == scenes.end() && !scenes.empty()) without_scene.Add(path, "has no body3DScene file of the same frame");
    try {
      CheckPeople(ReadPanopticLandmarks(path), kind, scene == scenes.end() ? nullptr : &scene->second.people, path, &faults);
      ++readable;
    } catch (const FormatError& error) {
      findings->Error(code, path, WithoutPath(error));
    } catch (const IoError& error) {
      findings->Error(code, path, error.what());
    }
  }
  faults.twice.Report(code, true, findings);
  faults.empty.Report(code, true, findings);
  faults.far.Report(code, false, findings);
  faults.strangers.Report(code, false, findings);
  without_scene.Report(code, false, findings);
  return readable;
}

void VerifySyncTables(const PanopticSequence& sequence, const std::map<int, Body3dScene>& hd_scenes, Findings* findings) {
  ReadTables(sequence.kinect_sync, findings);
  const PanopticSyncTables tables = ReadTables(sequence.sync, findings);
  const PanopticSyncTrack* hd = tables.Find("hd");
  if (!hd) return;
  std::map<int, double> times;
  for (const auto& [frame, scene] : hd_scenes) {
    if (scene.univ_time_ms >= 0) times[frame] = scene.univ_time_ms;
  }
  const PanopticTableMatch match = MatchPanopticTable(times, *hd);
  if (match.contradicts()) {
    findings->Error(
        "DAT-SYNC", sequence.sync,
        "hd: its times are " + NumberText(match.residual_ms) + " ms off those of the joints at the best of all shifts");
  } else if (match.compared > 0 && match.shift != 1) {
    findings->Warning(
        "DAT-SYNC", sequence.sync,
        "hd: frame f has the time univ_time[f + " + std::to_string(match.shift) + "]; scripts of the toolbox count on f + 1");
  }
}

}  // namespace mvstudio::dataset::internal
