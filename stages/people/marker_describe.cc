#include <cmath>

#include "core/format.h"
#include "core/join.h"
#include "stages/people/marker_export.h"
#include "stages/words.h"

namespace mvstudio::stages {
namespace {

using nlohmann::ordered_json;
using Person = MarkerReport::Person;

/// What no centres of joints tell.
constexpr char kNotDetermined[] =
    "tilt of the pelvis against the trunk, adduction and rotation of the knee, inversion of the foot, turn of the forearm";

int NumAtEnds(const Person& person) {
  int at_ends = 0;
  for (const markers::MarkerMotion& motion : person.after) at_ends += motion.missing_at_start + motion.missing_at_end;
  return at_ends;
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

ordered_json MovesJson(const Person& person) {
  ordered_json moves = ordered_json::array();
  for (const markers::Displacement::Move& move : person.moved.largest) {
    moves.push_back({{"joint", person.names[static_cast<size_t>(move.marker)]},
                     {"frame", person.first_frame + move.frame_idx},
                     {"moved_mm", 1000 * move.distance_m},
                     {"sigmas", FiniteOrNull(move.sigmas)}});
  }
  return moves;
}

ordered_json AnglesJson(const AngleReport& report) {
  ordered_json json;
  for (const AngleReport::Angle& angle : report.angles) {
    ordered_json& entry = json[angle.name] = {{"frames", angle.num_frames}, {"missing", angle.missing}};
    if (angle.num_frames == 0) continue;
    entry["min_deg"] = angle.min_deg;
    entry["max_deg"] = angle.max_deg;
    entry["median_sigma_deg"] = FiniteOrNull(angle.median_sigma_deg);
  }
  return json;
}

ordered_json PersonJson(const Person& person) {
  ordered_json joints = ordered_json::object();
  for (size_t m = 0; m < person.before.size(); ++m)
    joints[person.before[m].name] = MotionJson(person.before[m], person.after[m]);
  ordered_json json = {{"person", person.person},
                       {"first_frame", person.first_frame},
                       {"frames", person.num_frames},
                       {"gaps_filled", person.filled.num_gaps},
                       {"positions_filled", person.filled.num_positions},
                       {"positions_in_longer_gaps", person.filled.num_left},
                       {"positions_at_ends", NumAtEnds(person)},
                       {"acceleration_m_s2", FiniteOrNull(MeanAcceleration(person.before))},
                       {"filtered_acceleration_m_s2", FiniteOrNull(MeanAcceleration(person.after))},
                       {"moved_rms_mm", 1000 * person.moved.rms_m},
                       {"moved_max_mm", 1000 * person.moved.max_m},
                       {"moved_rms_sigmas", FiniteOrNull(person.moved.rms_sigmas)},
                       {"largest_moves", MovesJson(person)},
                       {"joints", joints}};
  if (person.bvh) {
    json["bvh"] = {{"joints", person.bvh->num_joints},
                   {"rms_mm", 1000 * person.bvh->rms_m},
                   {"max_mm", 1000 * person.bvh->max_m},
                   {"held_frames", person.bvh->num_held}};
  }
  if (person.angles) json["angles"] = AnglesJson(*person.angles);
  return json;
}

/// The farthest move, with its joint and frame, and what no gap is.
std::string EndOfLine(const Person& person, bool fills) {
  std::string text;
  if (!person.moved.largest.empty()) {
    const markers::Displacement::Move& move = person.moved.largest[0];
    text += Format(", %s at most (%s, frame %d)", LengthText(move.distance_m).c_str(),
                   person.names[static_cast<size_t>(move.marker)].c_str(), person.first_frame + move.frame_idx);
  }
  const int at_ends = NumAtEnds(person), longer = person.filled.num_left;
  if (fills && longer > 0) text += Format("; %d positions in longer gaps stay missing", longer);
  if (fills && at_ends > 0)
    text += Format("; %d positions before a joint's first or after its last are no gaps and stay missing", at_ends);
  return text;
}

std::string PersonLine(const Person& person, bool fills) {
  return Format(
             "person %d: %d frames, %d joints, %d positions filled in %d gaps; accelerations %.1f -> %.1f m/s2, moved by %s "
             "rms",
             person.person, person.num_frames, static_cast<int>(person.before.size()), person.filled.num_positions,
             person.filled.num_gaps, MeanAcceleration(person.before), MeanAcceleration(person.after),
             LengthText(person.moved.rms_m).c_str()) +
         EndOfLine(person, fills) + "\n";
}

std::string BvhLine(int person, const BvhFit& bvh) {
  return Format("person %d: bones of one length leave %s rms, %s at worst in the .bvh", person, LengthText(bvh.rms_m).c_str(),
                LengthText(bvh.max_m).c_str()) +
         (bvh.num_held > 0 ? Format("; held in %d frames without a root\n", bvh.num_held) : std::string("\n"));
}

std::string AnglesLine(int person, const AngleReport& report) {
  int told = 0, partly = 0;
  std::string gone;
  for (const AngleReport::Angle& angle : report.angles) {
    told += angle.num_frames > 0, partly += angle.num_frames > 0 && angle.num_frames < report.num_frames;
    if (angle.num_frames == 0) gone += (gone.empty() ? "" : ", ") + angle.name;
  }
  std::string text = Format("person %d: %d of %zu joint angles", person, told, report.angles.size());
  if (partly > 0) text += Format(", %d of them not in every frame (`status` says why)", partly);
  if (!gone.empty()) text += "; in no frame: " + gone;
  return text + "; no joint centres tell: " + kNotDetermined + "\n";
}

Notice OpenSimNotice(const Person& person) {
  return {"MRK-OPENSIM",
          Format("person %d: %zu of %zu joints have no place on OpenSim's model: %s; its files leave them out", person.person,
                 person.not_in_opensim.size(), person.names.size(), Join(person.not_in_opensim, ", ").c_str()),
          "the .trc holds them all; add them to the marker set if the model has a place for them"};
}

}  // namespace

CommandResult DescribeMarkers(const MarkerReport& report) {
  CommandResult result;
  if (report.without_bones) {
    result.exit = kExitPartial;
    result.warnings.push_back({"MRK-BVH", "the joints have no bones, of which a hierarchy could be made: no .bvh was written",
                               "name the bones in a file, option 'skeleton' FILE.toml (docs/formats.md)"});
  }
  ordered_json persons = ordered_json::array();
  for (const Person& person : report.persons) {
    if (!person.not_in_opensim.empty()) result.warnings.push_back(OpenSimNotice(person));
    persons.push_back(PersonJson(person));
    result.text += PersonLine(person, report.options.fill_frames > 0);
    if (person.bvh) result.text += BvhLine(person.person, *person.bvh);
    if (person.angles) result.text += AnglesLine(person.person, *person.angles);
  }
  for (const MarkerFileWritten& file : report.files) result.outputs.push_back({file.path, file.role});
  result.metrics["markers"] = {{"filter", ToText(markers::ParseFilter(report.options.filter))},
                               {"rate_hz", report.options.rate_hz},
                               {"fill_frames", report.options.fill_frames},
                               {"persons", persons}};
  return result;
}

}  // namespace mvstudio::stages
