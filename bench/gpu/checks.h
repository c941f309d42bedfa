#pragma once

#include <c10/core/Device.h>

#include <vector>

#include "bench/gpu/nets.h"
#include "bench/gpu/report.h"

namespace mvstudio::avatar {

/// Each network on the device beside the CPU in double: gradients in double, float32, TF32 and half precision, weights after
/// two steps, a rendered image; then the lifter and Adam. `spoil`: scales one tensor of the device's gradients by 1 + spoil.
void CheckNets(const std::vector<Net>& nets, const at::Device& device, double spoil, Report* report);
void CheckLifter(const at::Device& device, Report* report);
void CheckAdam(const at::Device& device, Report* report);

}  // namespace mvstudio::avatar
