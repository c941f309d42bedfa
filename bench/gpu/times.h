#pragma once

#include <c10/core/Device.h>

#include <vector>

#include "bench/gpu/nets.h"
#include "bench/gpu/report.h"

namespace mvstudio::avatar {

/// Seconds and peak memory of a training step against batch size and precision, and of a rendered image.
void TimeSteps(const std::vector<Net>& nets, const std::vector<int64_t>& batches, const at::Device& device, Report* report);

struct Schedule {
  int steps = 100;
  int batch = 2;
  int num_threads = 0;  // 0: all processors
};

/// Whole trainings: the loss must stay finite and fall, half precision must end as single does; how far two equal ones of up to
/// 25 steps part.
void TrainNets(const std::vector<Net>& nets, const Schedule& schedule, const at::Device& device, Report* report);

}  // namespace mvstudio::avatar
