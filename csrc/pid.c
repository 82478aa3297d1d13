/* PID with feed-forward for one axis. */
#include "hm2.h"

#include <math.h>

void hm2_pid_reset(hm2_pid *pid)
{
	pid->error = pid->integral = pid->output = 0.0;
	pid->saturated = pid->exceeded = pid->valid = 0;
}

static double limited(double value, double limit)
{
	if (limit <= 0.0)
		return value;
	return value > limit ? limit : value < -limit ? -limit : value;
}

static double without_deadband(double error, double deadband)
{
	if (fabs(error) <= deadband)
		return 0.0;
	return error > 0.0 ? error - deadband : error + deadband;
}

static double slope(double now, double before, double seconds, int valid)
{
	return valid && seconds > 0.0 ? (now - before) / seconds : 0.0;
}

/* Integration is part of the output, so a change of gain makes no jump; it stands still while it would only push
 * further against the limit. */
static void integrate(hm2_pid *pid, double error, double seconds)
{
	const double step = pid->i * error * seconds;
	if (pid->saturated && step * pid->output > 0.0)
		return;
	pid->integral = limited(pid->integral + step, pid->max_integral > 0.0 ? pid->max_integral : pid->max_output);
}

double hm2_pid_update(hm2_pid *pid, double command, double command_velocity, double feedback,
                      double feedback_velocity, double seconds)
{
	const double velocity =
		isnan(command_velocity) ? slope(command, pid->last_command, seconds, pid->valid) : command_velocity;
	const double measured =
		isnan(feedback_velocity) ? slope(feedback, pid->last_feedback, seconds, pid->valid) : feedback_velocity;
	const double acceleration = slope(velocity, pid->last_velocity, seconds, pid->valid);
	const double error = without_deadband(command - feedback, pid->deadband);
	pid->error = command - feedback;
	if (pid->max_error > 0.0 && !(fabs(pid->error) <= pid->max_error))
		pid->exceeded = 1;
	integrate(pid, error, seconds);
	const double wanted = pid->bias + pid->p * error + pid->integral + pid->d * (velocity - measured) +
	                      pid->ff0 * command + pid->ff1 * velocity + pid->ff2 * acceleration;
	pid->output = limited(wanted, pid->max_output);
	pid->saturated = pid->output != wanted;
	pid->last_command = command;
	pid->last_velocity = velocity;
	pid->last_feedback = feedback;
	pid->valid = 1;
	return pid->output;
}
