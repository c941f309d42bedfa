#pragma once

#include <string>
#include <vector>

#include "avatar/body/body_template.h"
#include "avatar/splats/cloud.h"

/// Gaussians in motion for the report's player: docs/formats.md.
namespace mvstudio::splats {

inline constexpr char kPlayerFileName[] = "player.bin";

/// The body at one time step.
struct PlayerTimeStep {
  int frame = 0;                               ///< number in the dataset
  const Eigen::Matrix3Xf* vertices = nullptr;  ///< (3, V) metres, world
};

struct PlayerLimits {
  size_t bytes = size_t{4} << 20;  ///< of the file
  size_t time_steps = 60;
};

/// The cloud and the body of some of the `time steps` (ascending frames), evenly spread, as many as fit; in 8 and 16 bits a
/// number, so that positions are right to a few tenths of a millimetre. Colours are those of degree 0 alone. Time steps with
/// vertices that are not finite are left out. Empty where not even one fits. Throws ContractViolation for arrays that do not
/// match.
std::string PlayerBytes(const Cloud& cloud, bool mip, const body::BodyTemplate& body,
                        const std::vector<PlayerTimeStep>& time_steps, const PlayerLimits& limits = {});

/// What is up in the world of posed bodies: from the lowest tenth of the body at rest to its highest, the mean of all time
/// steps; an axis of the world where one is within 25 degrees. Zero without a time step.
Eigen::Vector3f UpOf(const body::BodyTemplate& body, const std::vector<PlayerTimeStep>& time_steps);

}  // namespace mvstudio::splats
