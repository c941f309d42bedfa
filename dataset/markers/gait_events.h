#pragma once

#include <string>
#include <string_view>
#include <vector>

#include "dataset/markers/marker_take.h"

/// When feet meet the ground and leave it, proposed from joints.
namespace mvstudio::markers {

enum class GaitEventKind : uint8_t { kHeelStrike, kToeOff };
std::string_view ToString(GaitEventKind kind);  ///< "heel_strike", "toe_off"

/// How well two methods agree.
enum class GaitConfidence : uint8_t {
  kHigh,    ///< within 50 ms
  kMedium,  ///< within 100 ms
  kLow,     ///< farther apart, or the second method finds nothing there
};
std::string_view ToString(GaitConfidence confidence);

struct GaitEvent {
  int frame = 0;  ///< of the take's numbering
  bool left = false;
  GaitEventKind kind = GaitEventKind::kHeelStrike;
  GaitConfidence confidence = GaitConfidence::kLow;
  int velocity_frame = -1;  ///< by the foot's vertical velocity; valid where has_velocity_frame
  bool has_velocity_frame = false;
};

struct GaitReport {
  std::vector<GaitEvent> events;  ///< by frame
  std::string why_none;           ///< where there are none, in a sentence
  std::string note;               ///< what the feet lack, in a sentence; may be empty
  double speed_m_s = 0;           ///< of the pelvis, forwards, over the walking; about 0 on a treadmill
  double cadence_per_min = 0;     ///< steps
};

/// Zeni et al., Gait & Posture 27, 2008: a heel strike where the heel is farthest before the pelvis, a toe off where the toes
/// are farthest behind it, along the direction in which the hips face. Events count where heel strikes of both sides alternate
/// in even steps of 0.2 to 1.5 s, each with its heel ahead of the other by a fifth of the leg or more: nobody else walks.
/// Beside each stands the extremum of the vertical velocity of the foot's middle (O'Connor et al., Gait & Posture 25, 2007).
/// Ankles stand in for missing heels and toes, which is said. `has_up`: z is up in the world.
GaitReport FindGaitEvents(const MarkerTake& take, bool has_up);

/// frame,time_s,side,event,confidence,velocity_frame.
std::string GaitCsvText(const GaitReport& report, const MarkerTake& take);

}  // namespace mvstudio::markers
