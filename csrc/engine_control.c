/* Controllers inside the engine: PID per axis, and whatever the user has compiled. */
#include "engine.h"

#include <math.h>
#include <string.h>

static int refuse(hm2_error *error, uint32_t limit, uint32_t value)
{
	hm2_error_set(error, HM2_ERR_RANGE, "engine control");
	if (error) {
		error->expected = limit;
		error->received = value;
	}
	return HM2_ERR_RANGE;
}

int hm2_engine_add_control(struct hm2_engine *engine, hm2_control control, void *context, hm2_error *error)
{
	if (engine->control_count == HM2_ENGINE_CONTROLS || !control)
		return refuse(error, HM2_ENGINE_CONTROLS, engine->control_count);
	engine->controls[engine->control_count++] = (struct engine_control){control, context};
	return HM2_OK;
}

static int is_index(int32_t index, size_t count, int optional)
{
	return (optional && index == -1) || (index >= 0 && (size_t)index < count);
}

int hm2_engine_add_pid(struct hm2_engine *engine, const hm2_pid *settings, int32_t command,
                       int32_t command_velocity, int32_t feedback, int32_t feedback_velocity, int32_t output,
                       hm2_error *error)
{
	if (engine->axis_count == HM2_ENGINE_AXES)
		return refuse(error, HM2_ENGINE_AXES, engine->axis_count);
	if (!is_index(command, engine->output_count, 0) || !is_index(command_velocity, engine->output_count, 1) ||
	    !is_index(output, engine->output_count, 0))
		return refuse(error, (uint32_t)engine->output_count, (uint32_t)command);
	if (!is_index(feedback, engine->input_count, 0) || !is_index(feedback_velocity, engine->input_count, 1))
		return refuse(error, (uint32_t)engine->input_count, (uint32_t)feedback);
	engine->axes[engine->axis_count++] = (struct engine_axis){
		*settings, command, command_velocity, feedback, feedback_velocity, output};
	return HM2_OK;
}

const hm2_pid *hm2_engine_pid(const struct hm2_engine *engine, uint32_t axis)
{
	return axis < engine->axis_count ? &engine->axes[axis].pid : NULL;
}

static void set_settings(hm2_pid *pid, const hm2_pid *from)
{
	memcpy(pid, from, offsetof(hm2_pid, error));
}

int hm2_engine_set_pid(struct hm2_engine *engine, uint32_t axis, const hm2_pid *settings, hm2_error *error)
{
	if (axis >= engine->axis_count)
		return refuse(error, engine->axis_count, axis);
	if (!engine->status.running) {
		engine_take_settings(engine); /* older ones that no cycle came for */
		set_settings(&engine->axes[axis].pid, settings);
		return HM2_OK;
	}
	if (!atomic_load(&engine->running))
		engine_take_settings(engine); /* no thread would before the caller's next cycle */
	if (atomic_load_explicit(&engine->pending_full, memory_order_acquire))
		return hm2_error_set(error, HM2_ERR_BUSY, "engine settings");
	engine->pending_axis = &engine->axes[axis];
	engine->pending = *settings;
	atomic_store_explicit(&engine->pending_full, 1, memory_order_release);
	return HM2_OK;
}

void engine_take_settings(struct hm2_engine *engine)
{
	if (!atomic_load_explicit(&engine->pending_full, memory_order_acquire))
		return;
	set_settings(&engine->pending_axis->pid, &engine->pending);
	atomic_store_explicit(&engine->pending_full, 0, memory_order_release);
}

void engine_reset_axes(struct hm2_engine *engine)
{
	for (uint32_t i = 0; i < engine->axis_count; i++)
		hm2_pid_reset(&engine->axes[i].pid);
}

static double at(const double *values, int32_t index)
{
	return index < 0 ? NAN : values[index];
}

static void run_axis(struct hm2_engine *engine, uint32_t number, double seconds)
{
	struct engine_axis *axis = &engine->axes[number];
	const double *in = engine->input_values;
	double *out = engine->output_values;
	out[axis->output] = hm2_pid_update(&axis->pid, out[axis->command], at(out, axis->command_velocity),
	                                   in[axis->feedback], at(in, axis->feedback_velocity), seconds);
	if (!axis->pid.exceeded)
		return;
	engine_event(engine, HM2_EVENT_AXIS, (int)number, 0, 0, NULL);
	engine_off(engine, HM2_OFF_ERROR);
}

/* A number that is none must not reach an output: nobody knows what it would become there. */
static void check_numbers(struct hm2_engine *engine)
{
	for (size_t i = 0; i < engine->output_count; i++) {
		if (isfinite(engine->output_values[i]))
			continue;
		engine_event(engine, HM2_EVENT_CONTROL, (int)i, 0, 0, NULL);
		engine_off(engine, HM2_OFF_CONTROL);
		return;
	}
}

static void silence(struct hm2_engine *engine)
{
	for (size_t i = 0; i < engine->output_count; i++)
		if (!engine->outputs[i].hold)
			engine->output_values[i] = 0.0;
}

void engine_control(struct hm2_engine *engine)
{
	const double seconds = (double)(engine->config.period_ns * engine->elapsed_periods) * 1e-9;
	const int enabled = !engine->status.off;
	double held[HM2_ENGINE_SIGNALS];
	const size_t size = engine->output_count * sizeof *held;
	memcpy(held, engine->output_values, size);
	memcpy(engine->output_values, engine->commands, size);
	for (uint32_t i = 0; i < engine->control_count; i++)
		engine->controls[i].control(engine->controls[i].context, engine->input_values, engine->output_values,
		                            seconds, enabled);
	for (uint32_t i = 0; enabled && i < engine->axis_count; i++)
		run_axis(engine, i, seconds);
	if (enabled)
		check_numbers(engine);
	if (!engine->status.off)
		return;
	memcpy(engine->output_values, held, size); /* what holds, holds what was last sent */
	silence(engine);
}
